//! Observers of paths: layers, statistics, recordings for training.
//!
//! An estimator reports to an observer; one that does nothing costs nothing, since all calls are monomorphised.
//! Rendering observes with `()`, AOVs with [`Aovs`](crate::integrator::Aovs), training with a recorder of
//! [`Event`]s.

use super::shading_point::ShadingPoint;
use crate::bsdf::{Lobe, LobeQuery, SharedNumbers};
use crate::math::{Rgb, UVec2};

/// The technique that found an emitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// By sampling a light.
    Light,
    /// By a separate ray, drawn from the roughened lobe.
    Lobe,
    /// By the ray on which the path continues: a diffuse lobe draws the same direction at any roughness.
    Continuation,
}

/// One evaluation of a roughened BSDF towards a visible light.
///
/// Its contribution at any roughness a is `radiance · f(a) / (pdf_light + p(a))` with f and p of `query`; for a light
/// without area `radiance · f(a) / pdf_light`.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// f·|cos θi| and the density of the BSDF as functions of the roughness.
    pub query: LobeQuery,
    /// Path throughput before this vertex, times the emitted radiance.
    pub radiance: Rgb,
    /// Density of the light sample per steradian; for a light without area the probability of its choice.
    pub pdf_light: f32,
    /// True for a light without area.
    pub delta_light: bool,
    /// The technique that found the light.
    pub technique: Technique,
    /// The vertex's own roughness.
    pub alpha: f32,
    /// The roughness α′ > `alpha` at which the picture counts the event.
    pub alpha_reg: f32,
}

/// An observer of paths. All methods do nothing unless they are implemented.
pub trait PathObserver {
    /// Enables [`PathObserver::event`] and [`PathObserver::roughened`].
    const EVENTS: bool = false;

    /// True once no more paths are wanted: the estimator then skips the rest. Checked before every path.
    #[inline]
    fn stopped(&self) -> bool {
        false
    }
    /// A path starts.
    #[inline]
    fn begin(&mut self, _pixel: UVec2, _sample: u32) {}
    /// The path reached its `n`th scattering vertex (from 1), at this distance from the previous one.
    #[inline]
    fn vertex(&mut self, _n: u32, _distance: f32, _point: &ShadingPoint<'_>) {}
    /// A contribution whose size depends on the rule, in order of depth; at one vertex the light sample first. An event
    /// of [`Technique::Continuation`] is reported at the end of its ray, after [`PathObserver::scattered`].
    #[inline]
    fn event(&mut self, _event: &Event) {}
    /// A roughened lobe was sampled, with these random numbers, by a separate ray; an observer may draw from it
    /// [again](ShadingPoint::lobe_event).
    #[inline]
    fn roughened(&mut self, _point: &ShadingPoint<'_>, _u: &SharedNumbers) {}
    /// The path continues by this lobe.
    #[inline]
    fn sampled(&mut self, _lobe: Lobe) {}
    /// The path continues from a vertex whose sampled lobe has this roughness before regularisation.
    #[inline]
    fn scattered(&mut self, _alpha: f32) {}
    /// Called when light of this number of scatterings is added to the path's radiance; only the path tracer calls it.
    #[inline]
    fn light(&mut self, _scatterings: u32, _value: Rgb) {}
    /// Called with the light that the path has found before its first draw from a non-Dirac lobe. Only the path tracer
    /// and bidirectional camera walks call it.
    #[inline]
    fn dirac_only_light(&mut self, _value: Rgb) {}
    /// One of the path's ways through glass is complete, with this share of the path. Every way reports all of its
    /// vertices and light.
    #[inline]
    fn way(&mut self, _share: f32) {}
    /// The path is complete; `radiance` is the sum of its contributions.
    #[inline]
    fn finish(&mut self, _radiance: Rgb) {}
}

impl PathObserver for () {}

/// An observer that can be split over tiles and joined again, always in tile order.
pub trait Recorder: PathObserver + Send + Sync {
    /// An empty recorder for one tile.
    fn fork(&self) -> Self;
    /// Appends the records of a tile.
    fn join(&mut self, tile: Self);
}

impl Recorder for () {
    fn fork(&self) {}
    fn join(&mut self, (): ()) {}
}
