//! Scattering closures: small `Copy` values made at a hit, evaluated *at* a roughness.
//!
//! **The roughness is an argument** of [`Bsdf::eval`] and [`Bsdf::sample`]: "the original lobe" and "the roughened
//! lobe" are one closure read at two roughnesses. In a closure with a diffuse part, `alpha` addresses the glossy
//! lobe; the diffuse lobe has α = 1 by definition.
//!
//! All directions are **local**: unit length, leaving the surface, `z` along the (shading) normal of the front side.
//! Below [`DELTA_ALPHA`] a lobe is an exact Dirac delta: `eval` leaves it out, `sample` returns it with `delta` set.
//!
//! Every closure reduces a pair of directions to a [`LobeQuery`], in which all that depends on the roughness is
//! D·G and D·G1. Rendering evaluates the query at once; training keeps it and evaluates it at any roughness later,
//! in dual numbers: value and derivative cannot drift apart.

use crate::math::real::Real;
use crate::math::{Rgb, Vec3};

pub mod distribution;
pub mod fresnel;
pub mod lobes;

pub use distribution::Distribution;
pub use lobes::{Dielectric, Diffuse, Glossy, ThinDielectric};

/// Below this roughness a lobe is a Dirac delta: no single-precision form of a smooth lobe holds at grazing angles.
pub const DELTA_ALPHA: f32 = 1e-3;

/// What one pair of directions needs to be evaluated at any roughness α:
///
/// ```text
/// f·|cos θi| (α) = base + scale · D(α) G2(α)
/// pdf_w      (α) = base_pdf + pdf_scale · D(α) G1(α)        (G1 of wo: visible normals)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeQuery {
    /// f·|cos θi| of the parts that do not depend on α (the diffuse lobe).
    pub base: Rgb,
    /// Their density per steradian, selection probability included.
    pub base_pdf: f32,
    /// A: factor of D·G2 in f·|cos θi|.
    pub scale: Rgb,
    /// B: factor of D·G1(wo) in the density per steradian.
    pub pdf_scale: f32,
    /// tan² of the half vector's angle to the normal.
    pub tan2_h: f32,
    /// tan² of `wo`'s angle to the normal.
    pub tan2_o: f32,
    /// tan² of `wi`'s angle to the normal.
    pub tan2_i: f32,
    /// Normal distribution.
    pub distribution: Distribution,
}

/// Value of a closure for a pair of directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BsdfEval {
    /// f·|cos θi|, per steradian; Dirac lobes are left out.
    pub value: Rgb,
    /// Density with which [`Bsdf::sample`] at the same `alpha` draws `wi`, per steradian; Dirac lobes left out.
    pub pdf_w: f32,
}

/// Which part of a closure scattered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// The Lambertian part, α = 1.
    Diffuse,
    /// The glossy part, staying on the side of `wo`.
    Reflection,
    /// The glossy part, leaving on the other side.
    Transmission,
}

/// A direction drawn from a closure.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// The direction, local.
    pub wi: Vec3,
    /// f·|cos θi| / pdf of the whole closure (of the Dirac lobe alone if `delta`); finite and not negative.
    pub weight: Rgb,
    /// Density of the whole closure at `wi`, per steradian; meaningless (0) if `delta`.
    pub pdf_w: f32,
    /// The lobe that was drawn.
    pub lobe: Lobe,
    /// Whether that lobe is a Dirac delta at the α asked for.
    pub delta: bool,
}

/// A scattering closure.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf {
    /// Lambert, reflecting on both sides.
    Diffuse(Diffuse),
    /// Microfacet reflection with Schlick Fresnel, over a Lambertian base: metals, coated plastics and their blend.
    Glossy(Glossy),
    /// Interface of a solid transparent body: microfacet reflection and refraction.
    Dielectric(Dielectric),
    /// Thin-walled transmission: reflection, and transmission without refraction.
    Thin(ThinDielectric),
}

/// D·G2 and D·G1 of a [`LobeQuery`] at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct LobeShape<T> {
    /// D(α) G2(α), height-correlated masking and shadowing.
    pub dg2: T,
    /// D(α) G1(α) of `wo`.
    pub dg1: T,
}

impl LobeQuery {
    /// All that depends on the roughness; `alpha` must be above 0.
    ///
    /// G2 = 1/(1 + Λ(o) + Λ(i)) is the height-correlated form `[Heitz14 (99)]`, used for refraction too.
    #[inline]
    pub fn shape<T: Real>(&self, alpha: T) -> LobeShape<T> {
        let one = T::constant(1.0);
        let d = self.distribution.d(alpha, self.tan2_h);
        let masked = one + self.distribution.lambda(alpha, self.tan2_o);
        let shadowed = masked + self.distribution.lambda(alpha, self.tan2_i);
        LobeShape {
            dg2: d / shadowed,
            dg1: d / masked,
        }
    }

    /// Value and density at roughness `alpha`; below [`DELTA_ALPHA`] only the base is left.
    #[inline]
    pub fn at(&self, alpha: f32) -> BsdfEval {
        let mut eval = BsdfEval {
            value: self.base,
            pdf_w: self.base_pdf,
        };
        if alpha >= DELTA_ALPHA {
            let shape = self.shape(alpha);
            eval.value += self.scale * shape.dg2;
            eval.pdf_w += self.pdf_scale * shape.dg1;
        }
        eval
    }
}

impl Bsdf {
    /// The material's own roughness: of the glossy lobe, or 1 for a purely diffuse closure.
    #[inline]
    pub fn alpha(&self) -> f32 {
        match self {
            Self::Diffuse(_) => 1.0,
            Self::Glossy(l) => l.alpha,
            Self::Dielectric(l) => l.alpha,
            Self::Thin(l) => l.alpha,
        }
    }

    /// Reduces a pair of directions to what can be evaluated at any roughness; `None` where f is zero at every α
    /// (wrong side, half vector below the horizon).
    #[inline]
    pub fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        match self {
            Self::Diffuse(l) => l.query(wo, wi),
            Self::Glossy(l) => l.query(wo, wi),
            Self::Dielectric(l) => l.query(wo, wi),
            Self::Thin(l) => l.query(wo, wi),
        }
    }

    /// f·|cos θi| and density with the glossy lobe at roughness `alpha`.
    #[inline]
    pub fn eval(&self, alpha: f32, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.query(wo, wi)
            .map_or(BsdfEval::default(), |query| query.at(alpha))
    }

    /// Draws `wi` with the glossy lobe at roughness `alpha`. Whether the diffuse lobe is chosen depends on `wo` and `u`
    /// only, never on `alpha`; a diffuse choice therefore gives the same direction at every `alpha`.
    ///
    /// `None` where the direction drawn is not valid (below the horizon): zero in `eval` too, so nothing is lost.
    #[inline]
    pub fn sample(&self, alpha: f32, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(l) => l.sample(wo, u),
            Self::Glossy(l) => l.sample(alpha, wo, u),
            Self::Dielectric(l) => l.sample(alpha, wo, u),
            Self::Thin(l) => l.sample(alpha, wo, u),
        }
    }

    /// Whether nothing of the closure can be evaluated at roughness `alpha`: light sampling is of no use.
    #[inline]
    pub fn is_delta_at(&self, alpha: f32) -> bool {
        let has_base = match self {
            Self::Diffuse(_) => true,
            Self::Glossy(glossy) => glossy.albedo != Rgb::ZERO,
            // An interface between equal indices cannot be seen at any roughness.
            Self::Dielectric(l) if l.is_matched() => return true,
            Self::Dielectric(_) | Self::Thin(_) => false,
        };
        alpha < DELTA_ALPHA && !has_base
    }

    /// Whether the closure bounds a solid body that can be entered.
    #[inline]
    pub fn is_solid(&self) -> bool {
        matches!(self, Self::Dielectric(_))
    }

    /// (ηᵢ/ηₒ)² of a refraction seen from `wo`: what a refracted path's throughput was divided by.
    #[inline]
    pub fn refraction_scale(&self, wo: Vec3) -> f32 {
        match self {
            Self::Dielectric(d) if wo.z > 0.0 => d.eta * d.eta,
            Self::Dielectric(d) => 1.0 / (d.eta * d.eta),
            _ => 1.0,
        }
    }
}

const _: () = assert!(size_of::<Bsdf>() <= 64);

#[cfg(test)]
mod tests {
    use super::*;

    fn all(alpha: f32) -> [Bsdf; 5] {
        let distribution = Distribution::Ggx;
        let (f0, tint) = (Rgb::splat(0.04), Rgb::ONE);
        let glossy = |albedo| Glossy {
            f0,
            albedo,
            alpha,
            distribution,
        };
        let eta = 1.5;
        [
            Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }),
            Bsdf::Glossy(glossy(Rgb::ZERO)),
            Bsdf::Glossy(glossy(Rgb::new(0.0, 0.0, 0.1))),
            Bsdf::Dielectric(Dielectric {
                eta,
                tint,
                alpha,
                distribution,
            }),
            Bsdf::Thin(ThinDielectric {
                f0,
                tint,
                alpha,
                distribution,
            }),
        ]
    }

    #[test]
    fn what_closures_say_of_themselves() {
        let own = all(0.3).map(|b| b.alpha());
        assert_eq!(own, [1.0, 0.3, 0.3, 0.3, 0.3]);
        let solid = all(0.3).map(|b| b.is_solid());
        assert_eq!(solid, [false, false, false, true, false]);
        let below = all(0.3).map(|b| b.is_delta_at(DELTA_ALPHA.next_down()));
        assert_eq!(below, [false, true, false, true, true]);
        assert_eq!(all(0.0).map(|b| b.is_delta_at(DELTA_ALPHA)), [false; 5]);
    }

    #[test]
    fn refraction_scales_radiance_and_reflection_does_not() {
        let [diffuse, metal, _, glass, thin] = all(0.1);
        for wo in [Vec3::Z, -Vec3::Z] {
            for other in [diffuse, metal, thin] {
                assert_eq!(other.refraction_scale(wo), 1.0);
            }
        }
        assert_eq!(glass.refraction_scale(Vec3::Z), 2.25);
        assert_eq!(glass.refraction_scale(-Vec3::Z), 1.0 / 2.25);
    }

    #[test]
    fn equal_indices_are_delta_at_any_roughness() {
        let glass = |eta| {
            Bsdf::Dielectric(Dielectric {
                eta,
                tint: Rgb::ONE,
                alpha: 0.5,
                distribution: Distribution::Beckmann,
            })
        };
        // The switch is at a difference of 5e-4, either way.
        for (eta, matched) in [(1.0, true), (1.0004, true), (0.9996, true), (1.0006, false)] {
            assert_eq!(glass(eta).is_delta_at(1.0), matched, "{eta}");
            let oblique = Vec3::new(0.6, 0.0, 0.8);
            assert_eq!(
                glass(eta).query(oblique, oblique).is_none(),
                matched,
                "{eta}"
            );
        }
    }
}
