//! A vertex of either walk: its value towards the camera, and the densities of both walks.
//!
//! In every strategy the value is the one of the path tracer: f·|cos| for `wo` towards the *camera* and `wi` towards
//! the *light*, in the frame for `wo`. There is no adjoint BSDF: only the density depends on the walk, and the frame of
//! a density is the one for the direction its walk came from.

use super::weights::{Partial, clamped};
use crate::bsdf::{Bsdf, BsdfEval, LobeQuery};
use crate::integrator::walk::{Interaction, Surroundings};
use crate::math::{Frame, Ray, Rgb, Vec3};
use crate::scene::{Hit, Scene, Sighting, Surface};

/// A scattering vertex of a walk.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    /// Number of the vertex in its walk, from 1.
    pub(super) n: u32,
    /// True if the walk has come straight from the camera or the light, except for panes.
    pub(super) first: bool,
    /// The surface and BSDF follow from these two.
    pub(super) hit: Hit,
    pub(super) choice: f32,
    pub(super) surface: Surface,
    pub(super) bsdf: Bsdf,
    pub(super) alpha: f32,
    /// World direction towards the previous vertex.
    pub(super) back: Vec3,
    /// Shading frame for `back`, and `back` in it.
    pub(super) frame: Frame,
    pub(super) local: Vec3,
    /// Throughput before the vertex; in a light walk divided by |ng · back|: flux per area and cosine.
    pub(super) throughput: Rgb,
    pub(super) partial: Partial<f32>,
    /// True if the previous vertex allows merges here.
    pub(super) merges: bool,
    /// Media around the previous edge.
    pub(super) around: Surroundings,
}

/// Roughness from which walks of photon density estimation merge at a glossy lobe instead of following it, and from
/// which a surface allows no merges at its neighbours.
const MIN_MERGED: f32 = 0.25;

/// The rule of merges: walks merge at vertices between two neighbours that allow it.
///
/// An edge between two rough surfaces is sampled well by a connection, and one to a light by light sampling. Merges at
/// their ends would take most of the time, and correlate the errors of neighbouring pixels. So rough surfaces and
/// lights allow no merges at their neighbours. Two kinds of vertices allow them without being sharp: near ones, since
/// connections of short edges have a high variance, and the camera, since fewer light paths connect to it than there
/// are photons. The rule depends on the path alone, so that all strategies agree on its weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct MergeRule {
    /// Distance within which surfaces allow merges.
    pub(super) near: f32,
    /// True if lights allow merges, as in photon density estimation.
    pub(super) beside_lights: bool,
}

impl MergeRule {
    /// True if merges are allowed at a neighbour at this distance; `is_sharp` as [`Vertex::is_sharp`], true for the
    /// camera.
    #[inline]
    pub(super) fn allows(&self, is_sharp: bool, distance: f32) -> bool {
        is_sharp || distance < self.near
    }
}

impl Vertex {
    /// True if photon density estimation merges at the glossy lobe too, and not at the base alone.
    #[inline]
    pub(super) fn merges_gloss(&self) -> bool {
        !self.is_sharp()
    }

    /// True for a lobe whose edges are hard to connect.
    #[inline]
    pub(super) fn is_sharp(&self) -> bool {
        self.alpha < MIN_MERGED
    }

    /// True if only a Dirac lobe scatters here, to which nothing can be connected.
    pub(super) fn is_delta(&self) -> bool {
        self.bsdf.is_delta_at(self.alpha)
    }

    /// False where an opaque surface lies between `back` and `out`.
    #[inline]
    pub(super) fn scatters_to(&self, out: Vec3) -> bool {
        let ng = self.surface.ng;
        !self.bsdf.is_opaque() || self.back.dot(ng) * out.dot(ng) > 0.0
    }

    /// At a vertex of a camera walk: the value for light from `out`, and the density with which the walk draws it;
    /// `None` where nothing is scattered.
    #[inline]
    pub(super) fn towards_light(&self, out: Vec3) -> Option<BsdfEval> {
        let wi = self.frame.to_local(out);
        let lit = self.surface.allows_direction(out, wi.z);
        let eval = lit
            .then(|| self.bsdf.query(self.local, wi))??
            .at(self.alpha);
        (eval.value != Rgb::ZERO).then_some(eval)
    }

    /// At a vertex of a camera walk: the value for light from `out` of the lobes at which photon density estimation
    /// merges.
    #[inline]
    pub(super) fn merged_value(&self, out: Vec3) -> Option<Rgb> {
        let query = self.query_light(out)?;
        Some(if self.merges_gloss() {
            query.at(self.alpha).value
        } else {
            query.base
        })
    }

    /// At a vertex of a camera walk of photon density estimation: the value for light from `out` of the lobe that the
    /// walk follows, and the density with which it does; `None` where it follows none but Dirac lobes.
    #[inline]
    pub(super) fn sharp(&self, out: Vec3) -> Option<BsdfEval> {
        if self.merges_gloss() {
            return None;
        }
        // Of the glossy lobe alone: the base merges.
        let eval = self.query_light(out)?.gloss().at(self.alpha);
        (eval.value != Rgb::ZERO).then_some(eval)
    }

    #[inline]
    fn query_light(&self, out: Vec3) -> Option<LobeQuery> {
        let wi = self.frame.to_local(out);
        if out.dot(self.surface.ng) * wi.z <= 0.0 {
            return None;
        }
        self.bsdf.query(self.local, wi)
    }

    /// A vertex of a light walk with its textures filtered as for a camera walk; `None` if they are not filtered.
    #[inline]
    pub(super) fn seen_by_camera(&self, scene: &Scene, sight: &Sighting) -> Option<Self> {
        scene.is_filtered(self.surface.material).then(|| {
            let mut seen = *self;
            let footprint = || Some(sight.footprint());
            seen.bsdf = scene.bsdf_seen(&mut seen.surface, self.choice, footprint);
            seen.bsdf.set_eta(self.bsdf.eta());
            seen
        })
    }

    /// At a vertex of a light walk: the value towards a camera along `out`, and the density with which a camera walk
    /// from there draws `back`.
    #[inline]
    pub(super) fn towards_camera(&self, out: Vec3) -> Option<BsdfEval> {
        let (wo, wi) = self.seen_from(out)?;
        let eval = self.bsdf.eval(self.alpha, wo, wi);
        (eval.value != Rgb::ZERO).then_some(eval)
    }

    /// Density with which this walk draws `out`.
    #[inline]
    pub(super) fn pdf_on(&self, out: Vec3) -> f32 {
        let local = self.frame.to_local(out);
        if out.dot(self.surface.ng) * local.z <= 0.0 {
            return 0.0;
        }
        self.bsdf.pdf(self.alpha, self.local, local)
    }

    /// Density with which the other walk, coming from `out`, draws `back`.
    #[inline]
    pub(super) fn pdf_back(&self, out: Vec3) -> f32 {
        let pdf = |(from, to)| self.bsdf.pdf(self.alpha, from, to);
        self.seen_from(out).map_or(0.0, pdf)
    }

    /// `out` and `back` in the frame for `out`; `None` where that disagrees with the geometric normal about the side of
    /// `back`.
    #[inline]
    pub(super) fn seen_from(&self, out: Vec3) -> Option<(Vec3, Vec3)> {
        let frame = self.surface.frame_near(&self.frame, out);
        let back = if frame.n == self.frame.n {
            self.local
        } else {
            frame.to_local(self.back)
        };
        (self.back.dot(self.surface.ng) * back.z > 0.0).then(|| (frame.to_local(out), back))
    }

    /// True if another walk may draw another BSDF here.
    pub(super) fn chooses_bsdf(&self, scene: &Scene) -> bool {
        scene.material(&self.surface).chooses_bsdf()
    }

    /// Absolute geometric cosine with a direction, clamped as in all weights; 1 at a point of a medium, whose densities
    /// are per volume, and 0 along directions from which no light walk arrives.
    #[inline]
    pub(super) fn cos(&self, w: Vec3) -> f32 {
        if self.surface.is_in_medium() {
            return 1.0;
        }
        if self.surface.is_below(w) {
            return 0.0;
        }
        clamped(self.surface.ng.dot(w))
    }

    #[inline]
    pub(super) fn interaction(&self) -> Interaction<'_> {
        Interaction {
            surface: &self.surface,
            bsdf: &self.bsdf,
            frame: self.frame,
            wo: self.local,
            alpha: self.alpha,
        }
    }

    /// [`Vertex::unblocked`] towards the camera, through back faces that are hidden from it.
    pub(super) fn unblocked_to_camera(
        &self,
        scene: &Scene,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        (self.interaction()).unblocked_to_camera(scene, &self.around, ray, distance, panes)
    }

    /// Transmittance from here along a ray over a distance, through at most `panes` panes; `None` if something else
    /// blocks the ray.
    #[inline]
    pub(super) fn unblocked(
        &self,
        scene: &Scene,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        (self.interaction()).unblocked(scene, &self.around, ray, distance, panes)
    }
}
