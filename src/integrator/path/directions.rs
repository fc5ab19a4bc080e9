//! Policies that draw a path's next direction, from the BSDF alone or also from a guide.

use crate::bsdf::{LobeNumbers, SharedNumbers};
use crate::integrator::walk::shading_point::{Continuation, ShadingPoint};
use crate::integrator::walk::ways::Ways;
use crate::integrator::walk::{Arrival, Interaction, Walk};
use crate::math::{Rgb, Vec3};
use crate::sampler::{Sampler, VertexU};

/// A policy that draws the next directions of a path, and may learn from the light that the path finds.
pub(in crate::integrator) trait Directions {
    /// False where directions are drawn from the BSDF with the vertex's own numbers: a draw from a diffuse lobe then is
    /// one from the roughened BSDF too.
    const GUIDED: bool = true;

    /// Called at a vertex with its random numbers; a policy may draw more.
    fn arrive(&mut self, point: &ShadingPoint<'_>, u: &VertexU, sampler: &mut impl Sampler);

    /// Probability of the current way of the walk.
    #[inline(always)]
    fn share(&self) -> f32 {
        1.0
    }

    /// Switches to the next way; false after the last one.
    #[inline(always)]
    fn turn(&mut self) -> bool {
        false
    }

    /// Survival probability after the first draw from a non-Dirac lobe; `None` for certainty.
    #[inline(always)]
    fn survival(&self) -> Option<f32> {
        None
    }

    /// Density per steradian with which the world direction `wi` is drawn here; that of the BSDF is `pdf_w`.
    fn pdf(&self, wi: Vec3, pdf_w: f32) -> f32;

    /// Draws a direction, with the BSDF at roughness `alpha`; `None` where the path ends.
    fn sample(
        &mut self,
        point: &ShadingPoint<'_>,
        alpha: f32,
        u: &SharedNumbers,
    ) -> Option<Continuation>;

    /// Called with light found at the current vertex.
    fn found(&mut self, value: Rgb);

    /// Called with emission at the end of the edge from the current vertex, or of the camera ray.
    fn met(&mut self, value: Rgb);

    /// Called when the path continues from a vertex, with the throughput after it.
    fn leave(
        &mut self,
        vertex: &Interaction<'_>,
        next: &Continuation,
        throughput: Rgb,
        sampler: &mut impl Sampler,
    );

    /// Called at the end of each way of the path.
    fn finish(&mut self);

    /// True if emission at the end of the edge counts here, and not in [`Directions::beyond`] of an earlier vertex.
    #[inline(always)]
    fn counts(&self, _arrival: Option<&Arrival>) -> bool {
        true
    }

    /// Light that a policy itself finds at a vertex, such as by manifold sampling.
    #[inline(always)]
    fn beyond(
        &mut self,
        _walk: &Walk<'_>,
        _vertex: &Interaction<'_>,
        _point: &ShadingPoint<'_>,
        _u: &VertexU,
    ) -> Rgb {
        Rgb::ZERO
    }
}

/// Directions of the BSDF, along the ways of a camera walk one after another.
pub(in crate::integrator) struct BsdfAlone {
    ways: Ways,
    /// True until the first draw from a non-Dirac lobe.
    is_seen: bool,
}

impl BsdfAlone {
    /// Directions along the drawn way only.
    pub(in crate::integrator) fn drawn() -> Self {
        Self {
            ways: Ways::drawn(),
            is_seen: true,
        }
    }

    /// Directions along all ways.
    pub(in crate::integrator) fn on_all_ways() -> Self {
        Self {
            ways: Ways::all(),
            is_seen: true,
        }
    }
}

impl Directions for BsdfAlone {
    const GUIDED: bool = false;

    #[inline]
    fn arrive(&mut self, _: &ShadingPoint<'_>, _: &VertexU, _: &mut impl Sampler) {}

    #[inline]
    fn pdf(&self, _: Vec3, pdf_w: f32) -> f32 {
        pdf_w
    }

    #[inline(always)]
    fn sample(
        &mut self,
        point: &ShadingPoint<'_>,
        alpha: f32,
        u: &SharedNumbers,
    ) -> Option<Continuation> {
        let of_way;
        let mut u = u;
        if self.is_seen {
            let (bsdf, wo) = (point.bsdf, point.wo);
            of_way = SharedNumbers::new(self.ways.choose(bsdf, alpha, wo, u.uniform()));
            u = &of_way;
        }
        let next = point.sample(alpha, u);
        self.is_seen &= next.as_ref().is_some_and(|next| next.sample.delta);
        next
    }

    #[inline(always)]
    fn share(&self) -> f32 {
        self.ways.share()
    }

    #[inline(always)]
    fn turn(&mut self) -> bool {
        self.ways.turn()
    }

    #[inline(always)]
    fn survival(&self) -> Option<f32> {
        Some(self.ways.survival())
    }

    #[inline]
    fn found(&mut self, _: Rgb) {}

    #[inline]
    fn met(&mut self, _: Rgb) {}

    #[inline]
    fn leave(&mut self, _: &Interaction<'_>, _: &Continuation, _: Rgb, _: &mut impl Sampler) {}

    #[inline]
    fn finish(&mut self) {
        self.is_seen = true;
    }
}
