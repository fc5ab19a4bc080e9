//! Who listens to a path: ripgrep's `Sink` for light transport.
//!
//! The loop tells an observer what happens; an observer that wants nothing costs nothing, because the constants say
//! so at compile time. Rendering listens with `()`, AOVs with [`FirstHit`], training with a recorder of [`Event`]s.

use crate::bsdf::{Bsdf, LobeQuery};
use crate::math::{Rgb, UVec2, Vec3};
use crate::scene::{Scene, Surface};

/// How an emitter was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// By sampling a light.
    Light,
    /// By a direction drawn from the regularised closure.
    Lobe,
    /// By a direction that the closure draws at any roughness, that of a diffuse lobe.
    Diffuse,
}

/// One evaluation of a lobe whose roughness depends on the table, towards a visible light (method section 5).
///
/// Its contribution at any roughness a is `radiance · f(a) / (pdf_light + p(a))` with f and p of `query`; for a light
/// without area `radiance · f(a) / pdf_light`.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// f·|cos θi| and the density of the closure as functions of the roughness.
    pub query: LobeQuery,
    /// Path throughput before this vertex, times the emitted radiance.
    pub radiance: Rgb,
    /// Density of the light sample per steradian; for a light without area the probability of its choice.
    pub pdf_light: f32,
    /// Whether the light has no area.
    pub delta_light: bool,
    /// How the direction was drawn.
    pub technique: Technique,
    /// Whether the picture counts it: not if an observer alone asked for it, see [`PathObserver::draws`].
    pub counted: bool,
    /// The last vertex's own roughness.
    pub alpha: f32,
    /// The roughness α′ > `alpha` with which it was drawn and weighted.
    pub alpha_reg: f32,
}

/// A scattering vertex.
pub struct Vertex<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Number of the vertex, 1 for the first.
    pub n: u32,
    /// The point.
    pub surface: &'a Surface,
    /// The closure.
    pub bsdf: &'a Bsdf,
    /// World direction towards the previous vertex.
    pub wo: Vec3,
    /// Distance to the previous vertex.
    pub distance: f32,
    /// Roughness used at next-event estimation.
    pub alpha_reg: f32,
}

/// Listens to paths. All methods do nothing unless they are implemented.
pub trait PathObserver {
    /// Whether [`PathObserver::event`] is called.
    const EVENTS: bool = false;
    /// Whether [`PathObserver::vertex`] is called.
    const VERTICES: bool = false;

    /// A path starts.
    fn begin(&mut self, _pixel: UVec2, _sample: u32) {}
    /// The path met a surface that scatters.
    fn vertex(&mut self, _vertex: &Vertex<'_>) {}
    /// Further roughness at which a regularised lobe of this own roughness is drawn, for events alone.
    fn draws(&mut self, _alpha: f32) -> Vec<f32> {
        Vec::new()
    }
    /// A contribution that depends on the table, in order of depth; at one vertex those found by the light first. One
    /// that is [`Technique::Diffuse`] is told of at the end of its ray, after [`PathObserver::scattered`].
    fn event(&mut self, _event: &Event) {}
    /// The path goes on from a vertex whose sampled lobe has this own roughness.
    fn scattered(&mut self, _alpha: f32) {}
    /// The path is complete; `radiance` is all it carried.
    fn finish(&mut self, _radiance: Rgb) {}
}

impl PathObserver for () {}

/// An observer that can be split over tiles and put together again, always in tile order.
pub trait Recorder: PathObserver + Send + Sync {
    /// An empty recorder for one tile.
    fn fork(&self) -> Self;
    /// Takes what a tile recorded.
    fn join(&mut self, tile: Self);
}

impl Recorder for () {
    fn fork(&self) {}
    fn join(&mut self, (): ()) {}
}
