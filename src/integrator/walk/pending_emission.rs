//! Emission at the end of a walk's current ray, and its weight.

use crate::math::measure::balance;
use crate::math::{Rgb, Vec3};
use crate::scene::{Lights, Surface};

/// Weights of emission at the end of the current edge of a walk, which scale with its throughput.
pub(in crate::integrator) trait PendingWeight {
    /// Multiplies the weights.
    fn scale(&mut self, factor: Rgb);
    /// True if no emission at the end of the edge would count.
    fn is_zero(&self) -> bool;
}

/// Nothing beside the throughput.
impl PendingWeight for () {
    #[inline]
    fn scale(&mut self, _: Rgb) {}

    #[inline]
    fn is_zero(&self) -> bool {
        true
    }
}

/// Emission found at the end of a walk's edge.
pub(in crate::integrator) struct HitEmission<'a> {
    /// Radiance towards the walk.
    pub(in crate::integrator) radiance: Rgb,
    pub(super) lights: &'a Lights,
    pub(super) from: Vec3,
    pub(super) dir: Vec3,
    /// The surface that emits; `None` for the environment.
    pub(super) surface: Option<&'a Surface>,
}

impl HitEmission<'_> {
    /// Density per steradian with which light sampling at the previous vertex draws the direction.
    #[inline]
    pub(in crate::integrator) fn pdf_light(&self) -> f32 {
        match self.surface {
            Some(surface) => self.lights.pdf_emitter(self.from, surface),
            None => self.lights.pdf_environment(self.from, self.dir),
        }
    }
}

/// Weight of the emission at the end of the current ray.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct EmissionWeight {
    /// Throughput for the emission: that of the path, unless the BSDF at α′ differs from the one at α. Zero where a
    /// roughened lobe has counted the emission already.
    pub(in crate::integrator) throughput: Rgb,
    /// Density of the direction in the BSDF at α′, for the MIS weight against light sampling; `None` for camera rays
    /// and Dirac lobes, which count in full.
    pub(in crate::integrator) pdf_w: Option<f32>,
}

impl PendingWeight for EmissionWeight {
    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.throughput *= factor;
    }

    #[inline]
    fn is_zero(&self) -> bool {
        self.throughput == Rgb::ZERO
    }
}

impl EmissionWeight {
    /// Emission that counts in full.
    #[inline]
    pub(in crate::integrator) fn full(throughput: Rgb) -> Self {
        Self {
            throughput,
            pdf_w: None,
        }
    }

    /// The contribution of emission.
    #[inline]
    pub(in crate::integrator) fn contribution(&self, hit: &HitEmission<'_>) -> Rgb {
        match self.pdf_w {
            Some(pdf_w) => self.throughput * hit.radiance * balance(pdf_w, hit.pdf_light()),
            None => self.throughput * hit.radiance,
        }
    }
}
