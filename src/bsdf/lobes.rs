//! Lobes of the BSDFs in local directions, `z` up. Opaque BSDFs reflect on both sides.

use super::fresnel::{dielectric, schlick, schlick_average};
use super::{BsdfSample, DELTA_ALPHA, Distribution, Lobe, LobeNumbers, LobeQuery};
use crate::math::frame::tan2_theta;
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::FRAC_1_PI;

/// Lambertian reflection.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Reflectance in [0, 1].
    pub albedo: Rgb,
}

/// Microfacet reflection over a Lambertian base.
#[derive(Clone, Copy, Debug)]
pub struct Glossy {
    /// Reflectance at normal incidence in [0, 1], for Schlick's approximation. A drawn clear coat has it divided by its
    /// selection probability.
    pub f0: Rgb,
    /// Reflectance at grazing incidence, scaled as `f0` and at least its largest channel; 1 unless a file sets it.
    pub f90: f32,
    /// Reflectance of the base in [0, 1]; zero for a metal.
    pub albedo: Rgb,
    /// Original roughness in [0, 1].
    pub alpha: f32,
    /// Microfacet distribution.
    pub distribution: Distribution,
}

/// Interface between the outside (`z > 0`) and a solid body.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index of refraction inside over outside, above 0, usually at least 1.
    pub eta: f32,
    /// Factor of the transmitted light in [0, 1].
    pub tint: Rgb,
    /// Original roughness in [0, 1].
    pub alpha: f32,
    /// Microfacet distribution.
    pub distribution: Distribution,
}

/// Thin wall that reflects, and transmits without refraction.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Reflectance at normal incidence in [0, 1], for Schlick's approximation.
    pub f0: Rgb,
    /// Reflectance at grazing incidence in [0, 1], at least the largest channel of `f0`; 1 unless a file sets it.
    pub f90: f32,
    /// Index of refraction of a pane with two faces and the interreflection between them, where `f0` is a factor of the
    /// reflectance; 0 for Schlick's approximation of one face.
    pub eta: f32,
    /// Factor of the transmitted light in [0, 1].
    pub tint: Rgb,
    /// Original roughness in [0, 1].
    pub alpha: f32,
    /// Microfacet distribution.
    pub distribution: Distribution,
}

/// Query of a surface that scatters nothing.
pub(super) const NO_LOBE: LobeQuery = LobeQuery {
    base: Rgb::ZERO,
    base_pdf: 0.0,
    scale: Rgb::ZERO,
    pdf_scale: 0.0,
    tan2_h: 0.0,
    tan2_o: 0.0,
    tan2_i: 0.0,
    distribution: Distribution::Beckmann,
};

/// Difference of the indices below which an interface is invisible: refraction through a rough one tends to a straight
/// line, whose half vector single precision cannot resolve.
const MATCHED: f32 = 5e-4;

/// True for a ratio of indices so close to 1 that the interface is invisible.
#[inline]
pub(crate) fn is_matched(eta: f32) -> bool {
    (eta - 1.0).abs() < MATCHED
}

/// Negates `w` if `side` is negative: maps a direction on the side of `side` to the upper hemisphere and back.
#[inline]
pub(super) fn above(side: f32, w: Vec3) -> Vec3 {
    w * 1f32.copysign(side)
}

/// Mirror image of `w` about the half vector `h`, which may have any length.
#[inline]
pub(super) fn mirror(w: Vec3, h: Vec3) -> Vec3 {
    (2.0 * w.dot(h) / h.length_squared()) * h - w
}

/// Query of a microfacet reflection without its Fresnel term, and the cosine wo·h at the half vector. Both directions
/// above the surface.
#[inline]
pub(super) fn reflection(
    wo: Vec3,
    wi: Vec3,
    distribution: Distribution,
) -> Option<(LobeQuery, f32)> {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return None;
    }
    let h = wo + wi;
    // f cos θi = F D G2 / (4 cos θo) [Walter07 (20)]. The density of visible normals [HeitzDEon14 (2)] over the
    // Jacobian 4 o·h is D G1 / (4 cos θo).
    let scale = 0.25 / wo.z;
    let query = LobeQuery {
        base: Rgb::ZERO,
        base_pdf: 0.0,
        scale: Rgb::splat(scale),
        pdf_scale: scale,
        tan2_h: tan2_theta(h),
        tan2_o: tan2_theta(wo),
        tan2_i: tan2_theta(wi),
        distribution,
    };
    // Both directions are of unit length: o·h = i·h = |o + i| / 2.
    Some((query, (0.5 * h.length()).min(1.0)))
}

/// Sample of a smooth lobe. Value and density come from the query, so that the weight is exactly their ratio.
#[inline]
pub(super) fn finish(
    query: Option<LobeQuery>,
    alpha: f32,
    wi: Vec3,
    lobe: Lobe,
) -> Option<BsdfSample> {
    let eval = query?.at(alpha);
    (eval.pdf_w > 0.0).then(|| BsdfSample {
        wi,
        value: eval.value,
        weight: eval.value / eval.pdf_w,
        pdf_w: eval.pdf_w,
        lobe,
        delta: false,
    })
}

/// Sample of a Dirac lobe.
pub(super) fn delta(wi: Vec3, weight: Rgb, lobe: Lobe) -> Option<BsdfSample> {
    Some(BsdfSample {
        wi,
        value: Rgb::ZERO,
        weight,
        pdf_w: 0.0,
        lobe,
        delta: true,
    })
}

impl Diffuse {
    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        (wo.z > 0.0 && wi.z > 0.0).then(|| LobeQuery {
            base: self.albedo * (wi.z * FRAC_1_PI),
            base_pdf: wi.z * FRAC_1_PI,
            ..NO_LOBE
        })
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let local = warp::cosine_hemisphere(Vec2::new(u[1], u[2]));
        self.sample_along(wo, above(wo.z, local))
    }

    #[inline]
    pub(super) fn sample_along(&self, wo: Vec3, wi: Vec3) -> Option<BsdfSample> {
        let pdf_w = wi.z.abs() * FRAC_1_PI;
        (pdf_w > 0.0 && wo.z != 0.0).then(|| BsdfSample {
            wi,
            value: self.albedo * pdf_w,
            weight: self.albedo,
            pdf_w,
            lobe: Lobe::Diffuse,
            delta: false,
        })
    }
}

impl Glossy {
    /// Transmittance of the coat, inwards or outwards, at this cosine.
    #[inline]
    fn through(&self, cos: f32) -> Rgb {
        Rgb::ONE - schlick(self.f0, self.f90, cos)
    }

    /// Selection probability of the glossy lobe: its share of the light that a smooth coat and the base reflect at
    /// cos θo = `cos`. Depends on `wo` only.
    #[inline]
    pub(super) fn glossy_probability(&self, cos: f32) -> f32 {
        if self.albedo == Rgb::ZERO {
            return 1.0;
        }
        let glossy = luminance(schlick(self.f0, self.f90, cos));
        let base = luminance(self.albedo * self.through(cos));
        (glossy / (glossy + base)).clamp(0.05, 0.95)
    }

    /// Factor of albedo/π in the base's value at these cosines: transmittances of a smooth coat inwards and outwards,
    /// over their cosine-weighted mean.
    ///
    /// Deviates from glTF's (1 − F(o·h)) · albedo/π, which gains energy at grazing angles: up to 0.9 of the
    /// albedo on top of a mirror. The coupling by Kelemen and Szirmay-Kalos (2001) is reciprocal, does not
    /// depend on α, and with a smooth coat both lobes sum to exactly F + (1 − F) albedo. A rough coat may
    /// reflect more than the smooth one: a white base then gains up to 0.6 % (α = 0.2, 55°).
    #[inline]
    pub(super) fn coupling(&self, cos_o: f32, cos_i: f32) -> Rgb {
        let average = Rgb::ONE - schlick_average(self.f0, self.f90);
        self.through(cos_o) * self.through(cos_i) / average.max(Rgb::splat(1e-6))
    }

    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        let (mut query, cos_h) = reflection(wo, wi, self.distribution)?;
        query.scale *= schlick(self.f0, self.f90, cos_h);
        if self.albedo != Rgb::ZERO {
            let p = self.glossy_probability(wo.z);
            query.pdf_scale *= p;
            query.base_pdf = (1.0 - p) * wi.z * FRAC_1_PI;
            query.base = self.albedo * self.coupling(wo.z, wi.z) * (wi.z * FRAC_1_PI);
        }
        Some(query)
    }

    /// Value and density of a direction that was drawn.
    #[inline]
    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        if alpha < DELTA_ALPHA && lobe == Lobe::Reflection {
            let cos = wo.z.abs();
            let weight = schlick(self.f0, self.f90, cos) / self.glossy_probability(cos);
            return delta(wi, weight, lobe);
        }
        finish(self.query(wo, wi), alpha, wi, lobe)
    }

    /// Direction and lobe of a sample.
    #[inline]
    pub(super) fn direction(
        &self,
        alpha: f32,
        wo: Vec3,
        u: impl LobeNumbers,
    ) -> Option<(Vec3, Lobe)> {
        let [choice, x, y] = u.uniform();
        let side = wo.z;
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        if choice >= self.glossy_probability(wo.z) {
            let wi = warp::cosine_hemisphere(Vec2::new(x, y));
            return Some((above(side, wi), Lobe::Diffuse));
        }
        let wi = mirror(wo, self.distribution.sample_visible(alpha, wo, u));
        (wi.z > 0.0).then(|| (above(side, wi), Lobe::Reflection))
    }
}

impl Dielectric {
    /// True if the indices are so close that the interface is invisible.
    #[inline]
    pub(super) fn is_matched(&self) -> bool {
        is_matched(self.eta)
    }

    /// Index of the other side over the index on the side of `wo`.
    #[inline]
    fn relative(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Reflectance where the interface is smooth.
    pub(super) fn reflectance(&self, wo: Vec3) -> f32 {
        dielectric(wo.z.abs().min(1.0), self.relative(wo))
    }

    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        if wo.z == 0.0 || self.is_matched() {
            return None;
        }
        let eta = self.relative(wo);
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        if wi.z > 0.0 {
            let (mut query, cos_h) = reflection(wo, wi, self.distribution)?;
            let f = dielectric(cos_h, eta);
            query.scale *= f;
            query.pdf_scale *= f;
            return Some(query);
        }
        // Half vector of refraction [Walter07 (16)] with η_o = 1 and η_i = eta, not normalised, on the side of wo.
        let h = wo + eta * wi;
        let h = above(h.z, h);
        let length = h.length();
        let (oh, ih) = (wo.dot(h) / length, wi.dot(h) / length);
        if wi.z == 0.0 || oh <= 0.0 || ih >= 0.0 {
            return None;
        }
        let den = oh + eta * ih;
        let common = (1.0 - dielectric(oh.min(1.0), eta)) * oh * -ih / (wo.z * den * den);
        Some(LobeQuery {
            base: Rgb::ZERO,
            base_pdf: 0.0,
            // Radiance has η_o² in the numerator of [Walter07 (21)]; the Jacobian of the density (17) has η_i².
            scale: self.tint * common,
            pdf_scale: common * eta * eta,
            tan2_h: tan2_theta(h),
            tan2_o: tan2_theta(wo),
            tan2_i: tan2_theta(wi),
            distribution: self.distribution,
        })
    }

    /// Value and density of a direction that was drawn.
    #[inline]
    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        if self.is_matched() {
            return delta(wi, self.tint, lobe);
        }
        if alpha >= DELTA_ALPHA {
            return finish(self.query(wo, wi), alpha, wi, lobe);
        }
        let ratio = 1.0 / self.relative(wo);
        let weight = match lobe {
            Lobe::Transmission => self.tint * (ratio * ratio),
            _ => Rgb::ONE,
        };
        delta(wi, weight, lobe)
    }

    /// Direction and lobe of a sample.
    #[inline]
    pub(super) fn direction(
        &self,
        alpha: f32,
        wo: Vec3,
        u: impl LobeNumbers,
    ) -> Option<(Vec3, Lobe)> {
        let [choice, ..] = u.uniform();
        if self.is_matched() {
            return Some((-wo, Lobe::Transmission));
        }
        let side = wo.z;
        let eta = self.relative(wo);
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        let h = self.distribution.sample_visible(alpha, wo, u).normalize();
        let cos = wo.dot(h);
        if cos <= 0.0 {
            return None;
        }
        let f = dielectric(cos.min(1.0), eta);
        if choice < f {
            let wi = mirror(wo, h);
            return (wi.z > 0.0).then(|| (above(side, wi), Lobe::Reflection));
        }
        // Snell's law for vectors; the root is real because F < 1.
        let ratio = 1.0 / eta;
        let cos_t = (1.0 - ratio * ratio * ((1.0 - cos) * (1.0 + cos)))
            .max(0.0)
            .sqrt();
        let wi = (ratio * cos - cos_t) * h - ratio * wo;
        (wi.z < 0.0).then(|| (above(side, wi.normalize()), Lobe::Transmission))
    }
}

impl ThinDielectric {
    /// Share of light that a smooth wall lets straight through at this cosine.
    #[inline]
    pub(crate) fn straight_transmittance(&self, cos: f32) -> Rgb {
        let [_, rest] = self.parts(cos.abs().min(1.0));
        rest * self.tint
    }

    /// Selection probability of the reflection of a smooth wall.
    pub(super) fn reflectance(&self, wo: Vec3) -> f32 {
        luminance(self.parts(wo.z.abs().min(1.0))[0])
    }

    /// Reflected and transmitted shares of light in [0, 1] at this cosine, without `tint`. Two faces of reflectance r
    /// reflect r + (1 − r)² r + … = 2r/(1 + r); the factor `f0` absorbs a part of it.
    #[inline]
    fn parts(&self, cos: f32) -> [Rgb; 2] {
        if self.eta == 0.0 {
            let f = schlick(self.f0, self.f90, cos);
            return [f, Rgb::ONE - f];
        }
        let face = dielectric(cos, self.eta);
        let both = 2.0 * face / (1.0 + face);
        [self.f0 * both, Rgb::splat(1.0 - both)]
    }

    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        // The transmitted lobe is the mirror image of the reflected one.
        let through = wi.z < 0.0;
        let wi = if through {
            Vec3::new(wi.x, wi.y, -wi.z)
        } else {
            wi
        };
        let (mut query, cos_h) = reflection(wo, wi, self.distribution)?;
        let [f, rest] = self.parts(cos_h);
        let p = luminance(f);
        query.scale *= if through { rest * self.tint } else { f };
        query.pdf_scale *= if through { 1.0 - p } else { p };
        Some(query)
    }

    /// Value and density of a direction that was drawn.
    #[inline]
    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        if alpha >= DELTA_ALPHA {
            return finish(self.query(wo, wi), alpha, wi, lobe);
        }
        let [f, rest] = self.parts(wo.z.abs().min(1.0));
        let p = luminance(f);
        let weight = match lobe {
            Lobe::Transmission => rest * self.tint / (1.0 - p),
            _ => f / p,
        };
        delta(wi, weight, lobe)
    }

    /// Direction and lobe of a sample.
    #[inline]
    pub(super) fn direction(
        &self,
        alpha: f32,
        wo: Vec3,
        u: impl LobeNumbers,
    ) -> Option<(Vec3, Lobe)> {
        let [choice, ..] = u.uniform();
        let side = wo.z;
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        let wi = mirror(wo, self.distribution.sample_visible(alpha, wo, u));
        if wi.z <= 0.0 {
            return None;
        }
        let [f, _] = self.parts((0.5 * (wo + wi).length()).min(1.0));
        Some(if choice < luminance(f) {
            (above(side, wi), Lobe::Reflection)
        } else {
            (
                above(side, Vec3::new(wi.x, wi.y, -wi.z)),
                Lobe::Transmission,
            )
        })
    }
}
