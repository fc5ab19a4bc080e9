//! Results of all lobes: value and density as functions of the roughness, and sampled directions.

use super::{DELTA_ALPHA, Distribution, LobeReal};
use crate::math::{Rgb, Vec3};

/// Value and density of a BSDF for one pair of directions, as functions of the roughness α:
///
/// ```text
/// f·|cos θi| (α) = base + scale · D(α) G2(α)
/// pdf_w      (α) = base_pdf + pdf_scale · D(α) G1(α)        (G1 of wo: visible normals)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeQuery {
    /// f·|cos θi| of the diffuse lobe, which does not depend on α.
    pub base: Rgb,
    /// Density of the diffuse lobe per steradian, its selection probability included.
    pub base_pdf: f32,
    /// Factor of D·G2 in f·|cos θi|.
    pub scale: Rgb,
    /// Factor of D·G1(wo) in the density per steradian, selection probability included.
    pub pdf_scale: f32,
    /// tan² of the angle between half vector and normal. All three are of stretched directions for an
    /// [anisotropic](super::Anisotropic) lobe. Of a [phase function](super::Phase), tan² of half the angle to its peak.
    pub tan2_h: f32,
    /// tan² of the angle between `wo` and normal.
    pub tan2_o: f32,
    /// tan² of the angle between `wi` and normal.
    pub tan2_i: f32,
    /// Microfacet distribution.
    pub distribution: Distribution,
}

/// Value and sampling density of a BSDF for a pair of directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BsdfEval {
    /// f·|cos θi| per steradian, without Dirac lobes.
    pub value: Rgb,
    /// Density per steradian of [`Bsdf::sample`](super::Bsdf::sample) at the same `alpha`, without Dirac lobes.
    pub pdf_w: f32,
}

/// Lobe of a BSDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Lambertian lobe, α = 1; on both sides of a [`Translucent`](super::Translucent) surface.
    Diffuse,
    /// Glossy lobe on the side of `wo`.
    Reflection,
    /// Glossy lobe on the side opposite to `wo`.
    Transmission,
}

/// Direction sampled from a BSDF.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Sampled direction, local.
    pub wi: Vec3,
    /// f·|cos θi| of the whole BSDF; without meaning if `delta`.
    pub value: Rgb,
    /// f·|cos θi| / pdf of the whole BSDF; if `delta`, the Dirac lobe's weight alone over its selection probability.
    /// Finite and at least 0.
    pub weight: Rgb,
    /// Density of the whole BSDF at `wi` per steradian; 0 and without meaning if `delta`.
    pub pdf_w: f32,
    /// Sampled lobe.
    pub lobe: Lobe,
    /// True if the sampled lobe is a Dirac delta at this α.
    pub delta: bool,
}

/// Factors of a [`LobeQuery`] that depend on the roughness, at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct LobeShape<T> {
    /// D(α) G2(α), with height-correlated masking and shadowing.
    pub dg2: T,
    /// D(α) G1(α), with masking of `wo` alone.
    pub dg1: T,
}

impl LobeQuery {
    /// D·G2 and D·G1 at roughness `alpha` > 0.
    ///
    /// G2 = 1/(1 + Λ(o) + Λ(i)) is the height-correlated form `[Heitz14 (99)]`, used for refraction too.
    #[inline]
    pub fn shape<T: LobeReal>(&self, alpha: T) -> LobeShape<T> {
        let one = T::constant(1.0);
        let d = self.distribution.d(alpha, self.tan2_h);
        if d.value() == 0.0 {
            // Far from a sharp lobe D is 0, and masking is slow to compute.
            return LobeShape { dg2: d, dg1: d };
        }
        let masked = one + self.distribution.lambda(alpha, self.tan2_o);
        let shadowed = masked + self.distribution.lambda(alpha, self.tan2_i);
        LobeShape {
            dg2: d / shadowed,
            dg1: d / masked,
        }
    }

    /// True if there is no glossy lobe: its D and Λ are slow to compute, and would be multiplied by 0.
    #[inline]
    fn is_diffuse(&self) -> bool {
        self.pdf_scale == 0.0 && self.scale == Rgb::ZERO
    }

    /// The query of the glossy lobe alone, with its selection probability.
    #[inline]
    pub(crate) fn gloss(&self) -> Self {
        Self {
            base: Rgb::ZERO,
            base_pdf: 0.0,
            ..*self
        }
    }

    /// Density per steradian at roughness `alpha` in [0, 1]; that of the diffuse lobe alone below [`DELTA_ALPHA`].
    /// Bitwise equal to the density of [`LobeQuery::at`], without computing the value.
    #[inline]
    pub(crate) fn pdf(&self, alpha: f32) -> f32 {
        if alpha < DELTA_ALPHA || self.is_diffuse() {
            return self.base_pdf;
        }
        self.base_pdf + self.pdf_scale * self.shape(alpha).dg1
    }

    /// Value and density at roughness `alpha` in [0, 1]; those of the diffuse lobe alone below [`DELTA_ALPHA`].
    #[inline]
    pub fn at(&self, alpha: f32) -> BsdfEval {
        let mut eval = BsdfEval {
            value: self.base,
            pdf_w: self.base_pdf,
        };
        if alpha >= DELTA_ALPHA && !self.is_diffuse() {
            let shape = self.shape(alpha);
            eval.value += self.scale * shape.dg2;
            eval.pdf_w += self.pdf_scale * shape.dg1;
        }
        eval
    }
}
