//! BSDFs: small `Copy` values made at a hit and evaluated *at* a roughness.
//!
//! **The roughness is an argument** of [`Bsdf::eval`], [`Bsdf::pdf`] and [`Bsdf::sample`]: the original and the
//! roughened lobe are one BSDF evaluated at two values of α. In a BSDF with a diffuse part, `alpha` is the roughness of
//! the glossy lobe; the diffuse lobe has α = 1 by definition.
//!
//! All directions are **local**: unit length, leaving the surface, `z` along the shading normal of the front side. A
//! lobe with α < [`DELTA_ALPHA`] is a Dirac delta: `eval` and `pdf` leave it out, `sample` returns it with `delta` set.
//!
//! Every BSDF reduces a pair of directions to a [`LobeQuery`], which depends on the roughness only through D·G2 and
//! D·G1. Rendering evaluates the query at once. Training stores it and evaluates it at other roughness values in dual
//! numbers, so that value and derivative come from one formula.
//!
//! **Reciprocity.** [`Bsdf::eval`] gives radiance: `wo` is the direction towards the camera and `wi` the one towards
//! the light, whichever of them a walk arrives from. With η the index on the side of a direction,
//! f(wo, wi)/ηₒ² = f(wi, wo)/ηᵢ² `[Veach97 §5.2]`; reflection has ηₒ = ηᵢ.

use crate::math::{Rgb, Vec2, Vec3};

mod anisotropic;
mod clearcoated;
pub(crate) mod distribution;
pub(crate) mod film;
pub mod fresnel;
pub(crate) mod fresnel_glossy;
pub(crate) mod lobes;
mod numbers;
pub(crate) mod phase;
mod query;
pub(crate) mod sheen;
mod slope;
#[cfg(test)]
mod tests;
mod translucent;

pub use anisotropic::Anisotropic;
pub use clearcoated::{Covered, Covers, covered};
pub use distribution::{DELTA_ALPHA, Distribution, LobeReal};
pub use film::{Film, Iridescent, iridescent};
pub use fresnel_glossy::{FresnelGlossy, Interface};
pub(crate) use lobes::is_matched;
pub use lobes::{Dielectric, Diffuse, Glossy, ThinDielectric};
pub use numbers::{LobeNumbers, SharedNumbers};
pub use phase::Phase;
pub use query::{BsdfEval, BsdfSample, Lobe, LobeQuery, LobeShape};
pub use sheen::Sheen;
pub use translucent::Translucent;

/// Bidirectional scattering distribution function of a surface point.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf {
    /// Lambertian reflection on both sides.
    Diffuse(Diffuse),
    /// Microfacet reflection with Schlick's Fresnel term over a Lambertian base: metals, coated plastics and blends.
    Glossy(Glossy),
    /// Interface of a solid transparent body: microfacet reflection and refraction.
    Dielectric(Dielectric),
    /// Thin wall: microfacet reflection, and transmission without refraction.
    Thin(ThinDielectric),
    /// Base under a clear coat, or sheen.
    Covered(Covered),
    /// [`Glossy`] with a lobe of two roughnesses.
    Anisotropic(Anisotropic),
    /// [`Glossy`], [`Dielectric`] or [`ThinDielectric`] under a thin film.
    Iridescent(Iridescent),
    /// Sheen of fibres on a surface.
    Sheen(Sheen),
    /// [`Glossy`] with Fresnel's equations in place of Schlick's approximation.
    FresnelGlossy(FresnelGlossy),
    /// [`Glossy`] whose base scatters on both sides.
    Translucent(Translucent),
    /// A point of a medium: no surface, and no cosine in its value.
    Phase(Phase),
}

/// BSDF of `lobe` with roughness `along` the local tangent `direction`, of any length but 0, and roughness `across` it,
/// at most `along`; `lobe.alpha` is ignored. A mirror if `along` is below [`DELTA_ALPHA`]; otherwise `across` is raised
/// to it.
pub fn anisotropic(lobe: Glossy, along: f32, across: f32, direction: Vec2) -> Bsdf {
    match along < DELTA_ALPHA {
        true => Bsdf::Glossy(Glossy {
            alpha: along,
            ..lobe
        }),
        false => Bsdf::Anisotropic(Anisotropic::new(lobe, along, across, direction)),
    }
}

/// BSDF of `base` with a diffuse transmittance `transmitted` in [0, 1] added; only Lambertian and coated BSDFs change.
/// The base's albedo and transmittance are scaled down where they sum to more than 1.
pub fn translucent(base: Bsdf, transmitted: Rgb) -> Bsdf {
    let gloss = match base {
        _ if transmitted == Rgb::ZERO => return base,
        Bsdf::Diffuse(l) => Glossy {
            f0: Rgb::ZERO,
            f90: 0.0,
            albedo: l.albedo,
            alpha: 1.0,
            distribution: Distribution::Beckmann,
        },
        Bsdf::Glossy(l) => l,
        other => return other,
    };
    Bsdf::Translucent(Translucent::new(gloss, transmitted))
}

impl Bsdf {
    /// A surface that scatters nothing.
    pub(crate) const BLACK: Self = Self::Diffuse(Diffuse { albedo: Rgb::ZERO });

    /// Approximate reflectance plus transmittance: denoisers divide by it, and filters stop at its edges.
    pub fn reflectance(&self) -> Rgb {
        match self {
            Self::Diffuse(d) => d.albedo,
            Self::Glossy(g) => g.f0 + g.albedo * (Rgb::ONE - g.f0),
            Self::Anisotropic(a) => Self::Glossy(a.isotropic()).reflectance(),
            Self::Dielectric(d) => d.tint,
            Self::Thin(t) => t.tint,
            Self::Iridescent(l) => l.base().reflectance(),
            Self::Sheen(s) => s.color,
            Self::FresnelGlossy(e) => e.reflectance(),
            Self::Translucent(t) => Self::Glossy(t.folded()).reflectance(),
            Self::Phase(_) => Rgb::ONE,
            Self::Covered(c) => c.base().reflectance() * c.through(Vec3::Z, Vec3::Z),
        }
    }

    /// Original roughness of the glossy lobe; 1 for a purely diffuse BSDF. For an anisotropic lobe the geometric mean
    /// of its two roughnesses.
    #[inline(always)]
    pub fn alpha(&self) -> f32 {
        match self {
            Self::Diffuse(_) => 1.0,
            Self::Glossy(l) => l.alpha,
            Self::Dielectric(l) => l.alpha,
            Self::Thin(l) => l.alpha,
            Self::Covered(l) => l.base().alpha(),
            Self::Anisotropic(l) => l.isotropic().alpha,
            Self::Iridescent(l) => l.base().alpha(),
            Self::Sheen(_) => 1.0,
            Self::FresnelGlossy(l) => l.alpha,
            Self::Translucent(l) => l.coat().alpha,
            Self::Phase(l) => l.alpha(),
        }
    }

    /// Reduces a pair of directions to a [`LobeQuery`]. `None` where f is zero at every α: a direction on the wrong
    /// side, or a half vector below the horizon.
    #[inline]
    pub(crate) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        match self {
            Self::Diffuse(l) => l.query(wo, wi),
            Self::Glossy(l) => l.query(wo, wi),
            Self::Dielectric(l) => l.query(wo, wi),
            Self::Thin(l) => l.query(wo, wi),
            Self::Covered(l) => l.query(wo, wi),
            Self::Anisotropic(l) => l.query(wo, wi),
            Self::Iridescent(l) => l.query(wo, wi),
            Self::Sheen(l) => l.query(wo, wi),
            Self::FresnelGlossy(l) => l.query::<true>(wo, wi),
            Self::Translucent(l) => l.query(wo, wi),
            Self::Phase(l) => l.query(wo, wi),
        }
    }

    /// f·|cos θi| per steradian and density of [`Bsdf::sample`] per steradian, with the glossy lobe at roughness
    /// `alpha` in [0, 1]; Dirac lobes are left out.
    #[inline]
    pub fn eval(&self, alpha: f32, wo: Vec3, wi: Vec3) -> BsdfEval {
        match self {
            // Most vertices are diffuse: inlined, their query stays in registers.
            Self::Diffuse(l) => l.query(wo, wi),
            _ => return self.eval_microfacet(alpha, wo, wi),
        }
        .map_or(BsdfEval::default(), |query| query.at(alpha))
    }

    #[inline(never)]
    fn eval_microfacet(&self, alpha: f32, wo: Vec3, wi: Vec3) -> BsdfEval {
        let query = self.query(wo, wi);
        query
            .as_ref()
            .map_or(BsdfEval::default(), |query| query.at(alpha))
    }

    /// Density per steradian with which `sample(alpha, from, ..)` samples `to`: smooth lobes only, with the selection
    /// probability of each; 0 where nothing is sampled.
    ///
    /// `pdf(alpha, wo, wi)` is the density of a walk from the camera, `pdf(alpha, wi, wo)` that of a walk from the
    /// light. The arguments of [`Bsdf::eval`] are never swapped, because its value depends on their order.
    #[inline]
    pub fn pdf(&self, alpha: f32, from: Vec3, to: Vec3) -> f32 {
        let query = match self {
            Self::FresnelGlossy(l) => l.query::<false>(from, to),
            _ => self.query(from, to),
        };
        query.map_or(0.0, |query| query.pdf(alpha))
    }

    /// Samples `wi` with the glossy lobe at roughness `alpha` in [0, 1]; `u` is uniform in [0, 1)³. The choice of the
    /// diffuse lobe depends on `wo` and `u` only, so that it gives the same direction at every `alpha`.
    ///
    /// `None` if the sampled direction lies below the horizon, where `eval` is zero: the estimate stays unbiased.
    #[inline(always)]
    pub fn sample(&self, alpha: f32, wo: Vec3, u: impl LobeNumbers) -> Option<BsdfSample> {
        match self {
            // Most vertices are diffuse: inlined, their numbers stay in registers.
            Self::Diffuse(l) => l.sample(wo, u.uniform()),
            _ => self.sample_microfacet(alpha, wo, u),
        }
    }

    /// Sample of the Dirac `lobe` of smooth metal or glass for `wo`, its weight not divided by the selection
    /// probability. `None` if there is no such lobe, as for refraction beyond the critical angle.
    pub(crate) fn dirac(&self, wo: Vec3, lobe: Lobe) -> Option<BsdfSample> {
        let chance = match (self, lobe) {
            (Self::Dielectric(glass), Lobe::Reflection) => glass.reflectance(wo),
            (Self::Dielectric(glass), Lobe::Transmission) => 1.0 - glass.reflectance(wo),
            (Self::Glossy(_) | Self::FresnelGlossy(_), Lobe::Reflection) => 1.0,
            _ => return None,
        };
        let choice = if lobe == Lobe::Reflection {
            0.0
        } else {
            1.0 - f32::EPSILON
        };
        let sample = self.sample(0.0, wo, [choice, 0.5, 0.5])?;
        (sample.delta && sample.lobe == lobe).then_some(BsdfSample {
            weight: sample.weight * chance,
            ..sample
        })
    }

    /// Probability that [`Bsdf::sample`] draws reflection rather than transmission at smooth glass. `None` if only one
    /// of them can be drawn, for other BSDFs, and for glass under a film or a clear coat.
    #[inline]
    pub(crate) fn chance_of_reflection(&self, alpha: f32, wo: Vec3) -> Option<f32> {
        let chance = match self {
            Self::Dielectric(glass) if !glass.is_matched() => glass.reflectance(wo),
            Self::Thin(wall) => wall.reflectance(wo),
            _ => return None,
        };
        (alpha < DELTA_ALPHA && chance > 0.0 && chance < 1.0).then_some(chance)
    }

    #[inline(never)]
    fn sample_microfacet(&self, alpha: f32, wo: Vec3, u: impl LobeNumbers) -> Option<BsdfSample> {
        let (wi, lobe) = self.direction(alpha, wo, u)?;
        self.sample_along(alpha, wo, wi, lobe)
    }

    /// Direction and lobe of [`Bsdf::sample`] without the work for value and density. It may lie where `eval` is zero.
    #[inline]
    pub fn direction(&self, alpha: f32, wo: Vec3, u: impl LobeNumbers) -> Option<(Vec3, Lobe)> {
        match self {
            Self::Diffuse(l) => l.sample(wo, u.uniform()).map(|s| (s.wi, s.lobe)),
            Self::Glossy(l) => l.direction(alpha, wo, u),
            Self::Dielectric(l) => l.direction(alpha, wo, u),
            Self::Thin(l) => l.direction(alpha, wo, u),
            Self::Covered(l) => l.direction(alpha, wo, u),
            Self::Anisotropic(l) => l.direction_of(alpha, wo, u),
            Self::Iridescent(l) => l.direction(alpha, wo, u),
            Self::Sheen(l) => l.direction(wo, u.uniform()),
            Self::FresnelGlossy(l) => l.direction(alpha, wo, u),
            Self::Translucent(l) => l.direction(alpha, wo, u),
            Self::Phase(l) => Some(l.direction(alpha, wo, u)),
        }
    }

    /// The [`Bsdf::sample`] of a direction and lobe from [`Bsdf::direction`] at the same roughness: value and density.
    #[inline]
    pub(crate) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(l) => l.sample_along(wo, wi),
            Self::Glossy(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Dielectric(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Thin(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Covered(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Anisotropic(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Iridescent(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Sheen(l) => l.sample_along(wo, wi),
            Self::FresnelGlossy(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Translucent(l) => l.sample_along(alpha, wo, wi, lobe),
            Self::Phase(l) => l.sample_along(alpha, wo, wi, lobe),
        }
    }

    /// True if all lobes are Dirac deltas at roughness `alpha`: `eval` is zero, and sampled lights contribute nothing.
    #[inline]
    pub fn is_delta_at(&self, alpha: f32) -> bool {
        let has_base = match self {
            Self::Diffuse(_) | Self::Sheen(_) | Self::Translucent(_) => true,
            Self::Glossy(glossy) => glossy.albedo != Rgb::ZERO,
            // An interface between equal indices passes light straight on at any roughness.
            Self::Dielectric(l) if l.is_matched() => return true,
            Self::Dielectric(_) | Self::Thin(_) => false,
            Self::Covered(l) => return l.base().is_delta_at(alpha),
            Self::Anisotropic(l) => l.isotropic().albedo != Rgb::ZERO,
            Self::Iridescent(l) => return l.base().is_delta_at(alpha),
            Self::FresnelGlossy(l) => l.albedo() != Rgb::ZERO,
            Self::Phase(_) => false,
        };
        alpha < DELTA_ALPHA && !has_base
    }

    /// True for a Lambertian surface or fibres, under a clear coat or not.
    #[inline]
    pub(crate) fn is_diffuse(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Sheen(_) => true,
            Self::Translucent(l) => !l.is_coated(),
            Self::Covered(l) => l.base().is_diffuse(),
            _ => false,
        }
    }

    /// The BSDF without its diffuse lobe; a Lambertian one stays as it is.
    pub(crate) fn without_diffuse(&self) -> Self {
        match *self {
            Self::Glossy(l) => Self::Glossy(Glossy {
                albedo: Rgb::ZERO,
                ..l
            }),
            Self::Covered(l) => l.over(l.base().without_diffuse()),
            Self::Anisotropic(l) => Self::Anisotropic(l.without_diffuse()),
            Self::Iridescent(l) => Self::Iridescent(l.without_diffuse()),
            Self::FresnelGlossy(l) => Self::FresnelGlossy(l.without_diffuse()),
            Self::Translucent(l) if l.is_coated() => Self::Glossy(l.coat()),
            other => other,
        }
    }

    /// Name in listings of a path's vertices.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Diffuse(_) => "diffuse",
            Self::Glossy(_) => "glossy",
            Self::Dielectric(_) => "dielectric",
            Self::Thin(_) => "thin wall",
            Self::Covered(_) => "under a clear coat",
            Self::Anisotropic(_) => "anisotropic",
            Self::Iridescent(_) => "iridescent",
            Self::Sheen(_) => "sheen",
            Self::FresnelGlossy(_) => "glossy, exact",
            Self::Translucent(_) => "translucent",
            Self::Phase(_) => "medium",
        }
    }

    /// True for a bare opaque surface, which scatters only to the side of `wo`.
    #[inline]
    pub(crate) fn is_opaque(&self) -> bool {
        matches!(
            self,
            Self::Diffuse(_) | Self::Glossy(_) | Self::Anisotropic(_) | Self::FresnelGlossy(_)
        )
    }

    /// Albedo of the diffuse lobe under a gloss; black where there is none.
    pub(crate) fn base_albedo(&self) -> Rgb {
        match self {
            Self::Glossy(lobe) => lobe.albedo,
            Self::Anisotropic(lobe) => lobe.isotropic().albedo,
            Self::FresnelGlossy(lobe) => lobe.albedo(),
            Self::Translucent(lobe) => lobe.folded().albedo,
            Self::Iridescent(lobe) => match lobe.base() {
                Self::Glossy(lobe) => lobe.albedo,
                _ => Rgb::ZERO,
            },
            _ => Rgb::ZERO,
        }
    }

    /// True if the surface bounds a solid body that light can enter.
    #[inline]
    pub(crate) fn is_solid(&self) -> bool {
        match self {
            Self::Dielectric(_) => true,
            Self::Covered(l) => l.base().is_solid(),
            Self::Iridescent(l) => l.base().is_solid(),
            _ => false,
        }
    }

    /// The interface of a solid body, under a clear coat or not.
    #[inline]
    pub fn dielectric_mut(&mut self) -> Option<&mut Dielectric> {
        match self {
            Self::Dielectric(l) => Some(l),
            Self::Covered(l) => l.dielectric_mut(),
            Self::Iridescent(l) => l.dielectric_mut(),
            _ => None,
        }
    }

    /// Index of refraction of the body over that of its outside; `None` for surfaces that bound no body.
    pub(crate) fn eta(&self) -> Option<f32> {
        { *self }.dielectric_mut().map(|interface| interface.eta)
    }

    /// Sets the index of a body's interface, as [`Self::eta`]; without an index or an interface nothing changes.
    #[inline]
    pub(crate) fn set_eta(&mut self, eta: Option<f32>) {
        if let (Some(eta), Some(interface)) = (eta, self.dielectric_mut()) {
            interface.eta = eta;
        }
    }

    /// (ηᵢ/ηₒ)² of a refraction, with `wo` on the side of ηₒ: the factor by which refraction divides the radiance
    /// carried towards `wo` `[Walter07 (21)]`. 1 for BSDFs without refraction.
    #[inline]
    pub fn refraction_scale(&self, wo: Vec3) -> f32 {
        match self {
            Self::Dielectric(d) if wo.z > 0.0 => d.eta * d.eta,
            Self::Dielectric(d) => 1.0 / (d.eta * d.eta),
            Self::Covered(l) => l.base().refraction_scale(wo),
            Self::Iridescent(l) => l.base().refraction_scale(wo),
            _ => 1.0,
        }
    }
}

const _: () = assert!(size_of::<Bsdf>() <= 64);
