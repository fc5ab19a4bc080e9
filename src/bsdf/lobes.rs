//! The closures. Local directions, `z` up; opaque closures scatter from both sides.

use super::fresnel::{dielectric, schlick, schlick_average};
use super::{BsdfSample, DELTA_ALPHA, Distribution, Lobe, LobeQuery};
use crate::math::frame::tan2_theta;
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::FRAC_1_PI;

/// Lambert.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Reflectance in [0, 1].
    pub albedo: Rgb,
}

/// Microfacet reflection over a Lambertian base.
#[derive(Clone, Copy, Debug)]
pub struct Glossy {
    /// Reflectance at normal incidence in [0, 1] (Schlick).
    pub f0: Rgb,
    /// Reflectance of the base in [0, 1]; zero for a metal.
    pub albedo: Rgb,
    /// Own roughness.
    pub alpha: f32,
    /// Slope distribution.
    pub distribution: Distribution,
}

/// Interface between the outside (`z > 0`) and a solid body.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index of refraction inside over outside, >= 1 usually.
    pub eta: f32,
    /// Tint of the transmitted light in [0, 1].
    pub tint: Rgb,
    /// Own roughness.
    pub alpha: f32,
    /// Slope distribution.
    pub distribution: Distribution,
}

/// Thin wall.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Reflectance at normal incidence (Schlick).
    pub f0: Rgb,
    /// Tint of the transmitted light in [0, 1].
    pub tint: Rgb,
    /// Own roughness.
    pub alpha: f32,
    /// Slope distribution.
    pub distribution: Distribution,
}

/// Below this difference of the indices an interface is invisible: refraction through a rough one tends to a straight
/// line whose half vector single precision cannot tell.
const MATCHED: f32 = 5e-4;

/// A direction or its mirror image, so that the surface is seen from above.
#[inline]
fn above(side: f32, w: Vec3) -> Vec3 {
    w * 1f32.copysign(side)
}

/// Mirror image of `w` about the half vector `h` (any length).
#[inline]
fn mirror(w: Vec3, h: Vec3) -> Vec3 {
    (2.0 * w.dot(h) / h.length_squared()) * h - w
}

/// The query of a reflecting microfacet lobe without its colour, and the cosine at the half vector; both directions
/// above the surface.
#[inline]
fn reflection(wo: Vec3, wi: Vec3, distribution: Distribution) -> Option<(LobeQuery, f32)> {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return None;
    }
    let h = wo + wi;
    // |f cos| = F D G2 / (4 cos o), density of visible normals times 1/(4 o·h) = D G1 / (4 cos o)
    // [Walter07 (20)], [HeitzDEon14 (2)].
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

/// Finishes a smooth draw: value and density from the query itself, so that the weight is their ratio to the bit.
#[inline]
fn finish(query: Option<LobeQuery>, alpha: f32, wi: Vec3, lobe: Lobe) -> Option<BsdfSample> {
    let eval = query?.at(alpha);
    (eval.pdf_w > 0.0).then(|| BsdfSample {
        wi,
        weight: eval.value / eval.pdf_w,
        pdf_w: eval.pdf_w,
        lobe,
        delta: false,
    })
}

fn delta(wi: Vec3, weight: Rgb, lobe: Lobe) -> Option<BsdfSample> {
    Some(BsdfSample {
        wi,
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
            scale: Rgb::ZERO,
            pdf_scale: 0.0,
            tan2_h: 0.0,
            tan2_o: 0.0,
            tan2_i: 0.0,
            distribution: Distribution::Beckmann,
        })
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let local = warp::cosine_hemisphere(Vec2::new(u[1], u[2]));
        let pdf_w = local.z * FRAC_1_PI;
        (pdf_w > 0.0 && wo.z != 0.0).then(|| BsdfSample {
            wi: above(wo.z, local),
            weight: self.albedo,
            pdf_w,
            lobe: Lobe::Diffuse,
            delta: false,
        })
    }
}

impl Glossy {
    /// Light that the coat lets through, down or up, at this cosine.
    #[inline]
    fn through(&self, cos: f32) -> Rgb {
        Rgb::ONE - schlick(self.f0, cos)
    }

    /// Probability of the glossy lobe: its share of the reflected light if the coat were smooth. Depends on `wo` only.
    #[inline]
    fn glossy_probability(&self, cos: f32) -> f32 {
        if self.albedo == Rgb::ZERO {
            return 1.0;
        }
        let glossy = luminance(schlick(self.f0, cos));
        let base = luminance(self.albedo * self.through(cos));
        (glossy / (glossy + base)).clamp(0.05, 0.95)
    }

    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        let (mut query, cos_h) = reflection(wo, wi, self.distribution)?;
        query.scale *= schlick(self.f0, cos_h);
        if self.albedo != Rgb::ZERO {
            let p = self.glossy_probability(wo.z);
            query.pdf_scale *= p;
            query.base_pdf = (1.0 - p) * wi.z * FRAC_1_PI;
            // Deviates from glTF's (1 − F(o·h)) · albedo/π, which gains energy at grazing angles (up to 0.9 of albedo
            // on top of a mirror). This form is reciprocal, does not depend on α, and with a smooth coat the sum of
            // both lobes is exactly F + (1 − F) albedo (Kelemen, Szirmay-Kalos 2001). A rough coat may reflect more
            // than the smooth one it is taken for: a white base then gains up to 0.6 % (α 0.2, 55°).
            let average = Rgb::ONE - schlick_average(self.f0);
            let coupling = self.through(wo.z) * self.through(wi.z) / average.max(Rgb::splat(1e-6));
            query.base = self.albedo * coupling * (wi.z * FRAC_1_PI);
        }
        Some(query)
    }

    #[inline]
    pub(super) fn sample(&self, alpha: f32, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let side = wo.z;
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.glossy_probability(wo.z);
        if u[0] >= p {
            let wi = warp::cosine_hemisphere(Vec2::new(u[1], u[2]));
            return finish(self.query(wo, wi), alpha, above(side, wi), Lobe::Diffuse);
        }
        if alpha < DELTA_ALPHA {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            return delta(
                above(side, wi),
                schlick(self.f0, wo.z) / p,
                Lobe::Reflection,
            );
        }
        let wi = mirror(
            wo,
            self.distribution.sample_visible(alpha, wo, [u[1], u[2]]),
        );
        finish(self.query(wo, wi), alpha, above(side, wi), Lobe::Reflection)
    }
}

impl Dielectric {
    /// Whether there is nothing to see: the indices are equal.
    #[inline]
    pub(super) fn is_matched(&self) -> bool {
        (self.eta - 1.0).abs() < MATCHED
    }

    /// Index of the other side over that of `wo`'s.
    #[inline]
    fn relative(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
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
        // Half vector of refraction [Walter07 (16)], unnormalised, turned to wo's side: n_o = 1, n_i = eta.
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
            // [Walter07 (21)] for radiance: with n_o² on top; the density has n_i² (17).
            scale: self.tint * common,
            pdf_scale: common * eta * eta,
            tan2_h: tan2_theta(h),
            tan2_o: tan2_theta(wo),
            tan2_i: tan2_theta(wi),
            distribution: self.distribution,
        })
    }

    #[inline]
    pub(super) fn sample(&self, alpha: f32, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        if self.is_matched() {
            return delta(-wo, self.tint, Lobe::Transmission);
        }
        let side = wo.z;
        let eta = self.relative(wo);
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        let smooth = alpha < DELTA_ALPHA;
        let h = if smooth {
            Vec3::Z
        } else {
            self.distribution.sample_visible(alpha, wo, [u[1], u[2]])
        };
        let h = h.normalize();
        let cos = wo.dot(h);
        if cos <= 0.0 {
            return None;
        }
        let f = dielectric(cos.min(1.0), eta);
        if u[0] < f {
            let wi = if smooth {
                Vec3::new(-wo.x, -wo.y, wo.z)
            } else {
                mirror(wo, h)
            };
            let back = above(side, wi);
            if smooth {
                return delta(back, Rgb::ONE, Lobe::Reflection);
            }
            return finish(
                if wi.z > 0.0 {
                    self.query(above(side, wo), back)
                } else {
                    None
                },
                alpha,
                back,
                Lobe::Reflection,
            );
        }
        // Snell's law in vectors; F < 1 makes the root real.
        let ratio = 1.0 / eta;
        let cos_t = (1.0 - ratio * ratio * ((1.0 - cos) * (1.0 + cos)))
            .max(0.0)
            .sqrt();
        let wi = (ratio * cos - cos_t) * h - ratio * wo;
        if wi.z >= 0.0 {
            return None;
        }
        let wi = above(side, wi.normalize());
        if smooth {
            return delta(wi, self.tint * (ratio * ratio), Lobe::Transmission);
        }
        finish(
            self.query(above(side, wo), wi),
            alpha,
            wi,
            Lobe::Transmission,
        )
    }
}

impl ThinDielectric {
    #[inline]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        // The transmitted lobe is the reflected one, mirrored through the wall.
        let through = wi.z < 0.0;
        let wi = if through {
            Vec3::new(wi.x, wi.y, -wi.z)
        } else {
            wi
        };
        let (mut query, cos_h) = reflection(wo, wi, self.distribution)?;
        let f = schlick(self.f0, cos_h);
        let p = luminance(f);
        query.scale *= if through {
            (Rgb::ONE - f) * self.tint
        } else {
            f
        };
        query.pdf_scale *= if through { 1.0 - p } else { p };
        Some(query)
    }

    #[inline]
    pub(super) fn sample(&self, alpha: f32, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let side = wo.z;
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        let smooth = alpha < DELTA_ALPHA;
        let h = if smooth {
            Vec3::Z
        } else {
            self.distribution.sample_visible(alpha, wo, [u[1], u[2]])
        };
        let wi = if smooth {
            Vec3::new(-wo.x, -wo.y, wo.z)
        } else {
            mirror(wo, h)
        };
        if wi.z <= 0.0 {
            return None;
        }
        let f = schlick(self.f0, (0.5 * (wo + wi).length()).min(1.0));
        let p = luminance(f);
        let (through, lobe) = if u[0] < p {
            (false, Lobe::Reflection)
        } else {
            (true, Lobe::Transmission)
        };
        let wi = if through {
            Vec3::new(wi.x, wi.y, -wi.z)
        } else {
            wi
        };
        if smooth {
            let weight = if through {
                (Rgb::ONE - f) * self.tint / (1.0 - p)
            } else {
                f / p
            };
            return delta(above(side, wi), weight, lobe);
        }
        finish(self.query(wo, wi), alpha, above(side, wi), lobe)
    }
}
