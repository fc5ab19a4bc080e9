//! Base of a surface under a clear coat `[KHR_materials_clearcoat]`.
//!
//! A surface with a clear coat draws one of two BSDFs at every hit, as a partly transmissive one does: the coat, which is
//! a [`Glossy`] of its own roughness, or its base, which is one of these. So each has one roughness, which rules roughen
//! and classes count. With F the coat's reflectance (Schlick, index 1.5), c its weight and a the base's value:
//!
//! ```text
//! f(wo, wi) = c F(wo·h) D G2 / (4 cos θo cos θi) + (1 − c F(min(cos θo, cos θi))) a(wo, wi)
//! ```
//!
//! The extension takes F(cos θo) for the base, which is not reciprocal. The larger of both reflectances is, never keeps
//! more light, and with a smooth coat over a mirror the sum is exactly 1: what is lost is light that the coat returns to
//! a base that scatters widely.

use super::fresnel::schlick;
use super::{Anisotropic, ThinDielectric};
use super::{
    Bsdf, BsdfSample, Dielectric, Diffuse, Distribution, Glossy, Lobe, LobeNumbers, LobeQuery,
};
use crate::math::{Rgb, Vec3};

/// Reflectance of the coat at normal incidence: that of index 1.5.
const F0: f32 = 0.04;

/// Probability that the coat is drawn, per weight of the coat. It carries little light, but that of lamps.
const CHANCE: f32 = 0.25;

/// Base under a clear coat, drawn with the probability 1 − c/4.
#[derive(Clone, Copy, Debug)]
pub struct Clearcoated {
    base: Base,
    /// Weight c of the coat in [0, 1].
    coat: f32,
}

/// Any BSDF without a clear coat.
#[derive(Clone, Copy, Debug)]
enum Base {
    Diffuse(Diffuse),
    Glossy(Glossy),
    Dielectric(Dielectric),
    Thin(ThinDielectric),
    Anisotropic(Anisotropic),
}

/// The BSDF of a surface with a clear coat of weight `coat` in [0, 1] and roughness `alpha`: the coat or the base, with
/// the reciprocal of the chance of each; `u` is uniform in [0, 1). `base` makes the base's BSDF from another uniform
/// number.
pub fn clearcoated(
    coat: f32,
    alpha: f32,
    distribution: Distribution,
    u: f32,
    base: impl FnOnce(f32) -> Bsdf,
) -> Bsdf {
    let chance = CHANCE * coat;
    if u < chance {
        return Bsdf::Glossy(Glossy {
            f0: Rgb::splat(F0 / CHANCE),
            f90: 1.0 / CHANCE,
            albedo: Rgb::ZERO,
            alpha,
            distribution,
        });
    }
    let rest = ((u - chance) / (1.0 - chance)).min(1.0 - f32::EPSILON / 2.0);
    let base = match base(rest) {
        Bsdf::Diffuse(l) => Base::Diffuse(l),
        Bsdf::Glossy(l) => Base::Glossy(l),
        Bsdf::Dielectric(l) => Base::Dielectric(l),
        Bsdf::Thin(l) => Base::Thin(l),
        Bsdf::Anisotropic(l) => Base::Anisotropic(l),
        Bsdf::Clearcoated(l) => l.base,
    };
    Bsdf::Clearcoated(Clearcoated { base, coat })
}

impl Clearcoated {
    /// Another base under the same coat.
    pub(super) fn over(&self, base: Bsdf) -> Bsdf {
        // The base is drawn by the largest number.
        clearcoated(self.coat, 0.0, Distribution::Beckmann, 1.0, |_| base)
    }

    /// The base without its coat.
    pub fn base(&self) -> Bsdf {
        match self.base {
            Base::Diffuse(l) => Bsdf::Diffuse(l),
            Base::Glossy(l) => Bsdf::Glossy(l),
            Base::Dielectric(l) => Bsdf::Dielectric(l),
            Base::Thin(l) => Bsdf::Thin(l),
            Base::Anisotropic(l) => Bsdf::Anisotropic(l),
        }
    }

    /// The interface of a solid body under the coat.
    pub fn dielectric_mut(&mut self) -> Option<&mut Dielectric> {
        match &mut self.base {
            Base::Dielectric(l) => Some(l),
            _ => None,
        }
    }

    /// Share of the base's value that passes the coat, over the chance that the base was drawn.
    pub fn through(&self, wo: Vec3, wi: Vec3) -> f32 {
        let cos = wo.z.abs().min(wi.z.abs());
        let reflected = schlick(Rgb::splat(F0), 1.0, cos).x;
        (1.0 - self.coat * reflected) / (1.0 - CHANCE * self.coat)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let mut query = self.base().query(wo, wi)?;
        let through = self.through(wo, wi);
        query.base *= through;
        query.scale *= through;
        Some(query)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn direction(
        &self,
        alpha: f32,
        wo: Vec3,
        u: impl LobeNumbers,
    ) -> Option<(Vec3, Lobe)> {
        self.base().direction(alpha, wo, u)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn complete(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        let mut sample = self.base().complete(alpha, wo, wi, lobe)?;
        let through = self.through(wo, wi);
        sample.value *= through;
        sample.weight *= through;
        Some(sample)
    }
}
