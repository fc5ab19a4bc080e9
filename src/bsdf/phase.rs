//! Phase function of Henyey and Greenstein: *Diffuse radiation in the galaxy*, Astrophysical Journal 93, 1941.
//!
//! A point of a medium scatters like a surface point without a cosine: `eval` is the phase function, which is
//! normalised over the sphere, so that value and density are equal and the weight of a draw is 1.
//!
//! **Roughness.** α = 1 − |g|, with g the mean cosine of the deflection: 1 for isotropic scattering, 0 for none. The
//! median deflection of a sharp lobe is √3 (1 − |g|), and that of a Beckmann reflection of roughness α at normal
//! incidence 2 √(ln 2) α: 4 % less at equal α. `[OPSR §4.1]` names the mean cosine as a measure of roughness and leaves
//! the scale open.

use super::lobes::finish;
use super::{BsdfSample, DELTA_ALPHA, Distribution, Lobe, LobeNumbers, LobeQuery};
use crate::math::{Frame, Rgb, Vec3};
use std::f32::consts::TAU;

/// Greatest absolute mean cosine: beyond it the lobe is a Dirac delta in single precision.
pub(crate) const MAX_MEAN_COSINE: f32 = 1.0 - DELTA_ALPHA;

/// Phase function of a medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// Mean cosine g of the deflection in [−`MAX_MEAN_COSINE`, `MAX_MEAN_COSINE`]; positive for forward scattering.
    pub mean_cosine: f32,
}

impl Phase {
    /// Roughness 1 − |g| of the lobe, clamped so that rounding does not make it a Dirac delta.
    #[inline]
    pub(crate) fn alpha(&self) -> f32 {
        (1.0 - self.mean_cosine.abs()).max(DELTA_ALPHA)
    }

    /// Direction of the lobe's peak.
    #[inline]
    fn peak(&self, wo: Vec3) -> Vec3 {
        if self.mean_cosine < 0.0 { wo } else { -wo }
    }

    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let peak = self.peak(wo);
        // tan² of half the angle to the peak, which keeps its digits near the peak.
        let tan2 = (wi - peak).length_squared() / (wi + peak).length_squared();
        Some(LobeQuery {
            base: Rgb::ZERO,
            base_pdf: 0.0,
            scale: Rgb::ONE,
            pdf_scale: 1.0,
            tan2_h: tan2.min(1e30),
            tan2_o: 0.0,
            tan2_i: 0.0,
            distribution: Distribution::HenyeyGreenstein,
        })
    }

    /// A direction at roughness `alpha`: the inverse of the distribution function, written without a division by g.
    pub(super) fn direction(&self, alpha: f32, wo: Vec3, u: impl LobeNumbers) -> (Vec3, Lobe) {
        let [_, u, v] = u.uniform();
        let g = 1.0 - alpha;
        let s = alpha + 2.0 * g * u;
        // 1 − cos θ in [0, 2].
        let off = (2.0 * alpha * alpha * (1.0 - u) * (1.0 + g * u) / (s * s)).min(2.0);
        let sin = (off * (2.0 - off)).max(0.0).sqrt();
        let (turn_sin, turn_cos) = (TAU * v).sin_cos();
        let frame = Frame::from_normal(self.peak(wo));
        let wi = frame.to_world(Vec3::new(sin * turn_cos, sin * turn_sin, 1.0 - off));
        // By the original roughness, so that regularisation does not change the lobe.
        let lobe = if self.alpha() < 1.0 {
            Lobe::Reflection
        } else {
            Lobe::Diffuse
        };
        (wi.normalize(), lobe)
    }

    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        finish(self.query(wo, wi), alpha, wi, lobe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::Bsdf;

    const COSINES: [f32; 8] = [-0.95, -0.5, 0.0, 0.1, 0.5, 0.8, 0.95, 0.995];
    const WO: Vec3 = Vec3::new(0.48, -0.6, 0.64);

    fn bsdf(mean_cosine: f32) -> Bsdf {
        Bsdf::Phase(Phase { mean_cosine })
    }

    /// The sharpest lobe is no Dirac delta, although 1 − |g| is rounded to less than [`DELTA_ALPHA`].
    #[test]
    fn phase_of_the_greatest_mean_cosine_scatters() {
        for g in [MAX_MEAN_COSINE, -MAX_MEAN_COSINE] {
            let alpha = Phase { mean_cosine: g }.alpha();
            let sample = bsdf(g).sample(alpha, WO, [0.3, 0.6, 0.2]).unwrap();
            assert!(!sample.delta && sample.pdf_w > 0.0, "{sample:?}");
            assert!(bsdf(g).eval(alpha, WO, sample.wi).pdf_w > 0.0);
        }
    }

    #[test]
    fn phase_reciprocity_and_weight() {
        for g in COSINES {
            for wi in [
                Vec3::new(0.6, 0.0, 0.8),
                -WO,
                WO,
                Vec3::new(0.0, -0.8, -0.6),
            ] {
                for alpha in [1.0 - g.abs(), 0.5, 1.0] {
                    let there = bsdf(g).eval(alpha, WO, wi);
                    let back = bsdf(g).eval(alpha, wi, WO);
                    assert_eq!(there, back, "{g} {wi}");
                    assert_eq!(there.value, Rgb::splat(there.pdf_w));
                    assert!(there.pdf_w.is_finite() && there.pdf_w > 0.0);
                }
            }
            let sample = bsdf(g).sample(1.0 - g.abs(), WO, [0.3, 0.6, 0.2]).unwrap();
            assert_eq!(sample.weight, Rgb::ONE);
        }
    }
}
