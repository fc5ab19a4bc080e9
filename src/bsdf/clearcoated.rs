//! Base of a surface under a clear coat `[KHR_materials_clearcoat]`, sheen `[KHR_materials_sheen]`, or both.
//!
//! A surface with a clear coat draws one of two BSDFs at every hit, as a partly transmissive one does: the coat, which
//! is a [`Glossy`] of its own roughness, or the base, which is a [`Covered`]. Each has a single roughness, as rules
//! and classes require. With F the coat's reflectance (Schlick, index 1.5), c its weight and a the base's value:
//!
//! ```text
//! f(wo, wi) = c F(wo·h) D G2 / (4 cos θo cos θi) + (1 − c F(min(cos θo, cos θi))) a(wo, wi)
//! ```
//!
//! The extension takes F(cos θo) for the base, which is not reciprocal. The larger of both reflectances is reciprocal
//! and transmits no more light. A smooth coat over a mirror reflects exactly 1 in total. The model omits only light
//! that the coat reflects back to a diffuse or rough base.
//!
//! Sheen lies between coat and base and is drawn in the same way. It dims the base by its reflectance E as in the
//! extension, but by the larger of both directions: 1 − max(colour) max(E(cos θo), E(cos θi)).

use super::fresnel::schlick;
use super::sheen::{Sheen, sheen_albedo};
use super::{Anisotropic, FresnelGlossy, Iridescent, ThinDielectric, Translucent};
use super::{
    Bsdf, BsdfSample, Dielectric, Diffuse, Distribution, Glossy, Lobe, LobeNumbers, LobeQuery,
};
use crate::math::{Rgb, Vec3};

/// Reflectance of the coat at normal incidence: that of index 1.5.
const F0: f32 = 0.04;

/// Probability that the coat is drawn, per weight of the coat. The coat reflects little light except highlights.
const CHANCE: f32 = 0.25;

/// Probability that the sheen is drawn where the coat is not, per largest channel of its colour.
const SHEEN_CHANCE: f32 = 0.3;

/// Base under a clear coat, drawn with the probability 1 − c/4, under sheen, or both.
#[derive(Clone, Copy, Debug)]
pub struct Covered {
    base: Base,
    /// Weight c of the coat in [0, 1].
    coat: f32,
    /// Largest channel and roughness of the sheen on the base.
    sheen: [f32; 2],
}

/// Any BSDF without a clear coat.
#[derive(Clone, Copy, Debug)]
enum Base {
    Diffuse(Diffuse),
    Glossy(Glossy),
    Dielectric(Dielectric),
    Thin(ThinDielectric),
    Anisotropic(Anisotropic),
    Iridescent(Iridescent),
    Sheen(Sheen),
    Exact(FresnelGlossy),
    Translucent(Translucent),
}

/// Coat and sheen over a base.
#[derive(Clone, Copy, Debug)]
pub struct Covers {
    /// Weight of the clear coat in [0, 1].
    pub coat: f32,
    /// Roughness of the coat.
    pub alpha: f32,
    /// Slope distribution of the coat.
    pub distribution: Distribution,
    /// Sheen below the coat; black for none.
    pub sheen: Sheen,
}

impl Default for Covers {
    /// A smooth coat of weight 1 without sheen.
    fn default() -> Self {
        Self {
            coat: 1.0,
            alpha: 0.0,
            distribution: Distribution::Ggx,
            sheen: Sheen::NONE,
        }
    }
}

/// Maps a uniform number in [`chance`, 1) to a uniform number in [0, 1).
fn rest(u: f32, chance: f32) -> f32 {
    ((u - chance) / (1.0 - chance)).min(1.0 - f32::EPSILON / 2.0)
}

/// The BSDF of a covered surface, drawn from coat, sheen and base, with the reciprocal of the chance of
/// each; `u` is uniform in [0, 1). `base` makes the base's BSDF from another uniform number.
pub fn covered(covers: &Covers, u: f32, base: impl FnOnce(f32) -> Bsdf) -> Bsdf {
    let Covers {
        coat,
        alpha,
        distribution,
        sheen,
    } = *covers;
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
    let u = rest(u, chance);
    let most = sheen.color.max_element();
    if most == 0.0 {
        return Covered::under(base(u), coat, [0.0; 2]);
    }
    let chance = SHEEN_CHANCE * most;
    if u >= chance {
        return Covered::under(base(rest(u, chance)), coat, [most, sheen.alpha]);
    }
    let drawn = Bsdf::Sheen(Sheen {
        color: sheen.color / chance,
        ..sheen
    });
    match coat {
        0.0 => drawn,
        _ => Covered::under(drawn, coat, [0.0; 2]),
    }
}

impl Covered {
    /// Another base under the same coat.
    pub(super) fn over(&self, base: Bsdf) -> Bsdf {
        Self::under(base, self.coat, self.sheen)
    }

    fn under(base: Bsdf, coat: f32, sheen: [f32; 2]) -> Bsdf {
        let base = match base {
            Bsdf::Diffuse(l) => Base::Diffuse(l),
            Bsdf::Glossy(l) => Base::Glossy(l),
            Bsdf::Dielectric(l) => Base::Dielectric(l),
            Bsdf::Thin(l) => Base::Thin(l),
            Bsdf::Anisotropic(l) => Base::Anisotropic(l),
            Bsdf::Iridescent(l) => Base::Iridescent(l),
            Bsdf::Sheen(l) => Base::Sheen(l),
            Bsdf::FresnelGlossy(l) => Base::Exact(l),
            Bsdf::Translucent(l) => Base::Translucent(l),
            Bsdf::Covered(l) => l.base,
            // A medium has no surface and no coat.
            Bsdf::Phase(_) => return base,
        };
        Bsdf::Covered(Self { base, coat, sheen })
    }

    /// The base without its coat.
    pub(crate) fn base(&self) -> Bsdf {
        match self.base {
            Base::Diffuse(l) => Bsdf::Diffuse(l),
            Base::Glossy(l) => Bsdf::Glossy(l),
            Base::Dielectric(l) => Bsdf::Dielectric(l),
            Base::Thin(l) => Bsdf::Thin(l),
            Base::Anisotropic(l) => Bsdf::Anisotropic(l),
            Base::Iridescent(l) => Bsdf::Iridescent(l),
            Base::Sheen(l) => Bsdf::Sheen(l),
            Base::Exact(l) => Bsdf::FresnelGlossy(l),
            Base::Translucent(l) => Bsdf::Translucent(l),
        }
    }

    /// The interface of a solid body under the coat.
    pub(crate) fn dielectric_mut(&mut self) -> Option<&mut Dielectric> {
        match &mut self.base {
            Base::Dielectric(l) => Some(l),
            Base::Iridescent(l) => l.dielectric_mut(),
            _ => None,
        }
    }

    /// Share of the base's value that passes the coat, over the chance that the base was drawn.
    pub(crate) fn through(&self, wo: Vec3, wi: Vec3) -> f32 {
        let cos = wo.z.abs().min(wi.z.abs());
        let reflected = schlick(Rgb::splat(F0), 1.0, cos).x;
        let through = (1.0 - self.coat * reflected) / (1.0 - CHANCE * self.coat);
        match self.sheen {
            [0.0, _] => through,
            [most, alpha] => {
                let albedo = |w: Vec3| sheen_albedo(alpha, w.z.abs());
                let kept = 1.0 - most * albedo(wo).max(albedo(wi));
                through * kept / (1.0 - SHEEN_CHANCE * most)
            }
        }
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
    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        let mut sample = self.base().sample_along(alpha, wo, wi, lobe)?;
        let through = self.through(wo, wi);
        sample.value *= through;
        sample.weight *= through;
        Some(sample)
    }
}
