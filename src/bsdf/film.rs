//! Iridescence `[KHR_materials_iridescence]`: a thin film whose two reflections interfere, over a surface of any kind.
//!
//! Belcour, Barla: *A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence*, SIGGRAPH 2017:
//! Airy's sum, integrated over the eye's sensitivities with four bounces inside the film. The extension's listing has
//! two. Interfaces reflect by Schlick's approximation, as in the extension. The reflectance depends on the half vector
//! alone, so that the lobes are reciprocal; the extension's listing takes the angle of view for the base.

use super::fresnel::{dielectric, schlick};
use super::lobes::{above, finish, mirror};
use super::{
    BsdfSample, DELTA_ALPHA, Dielectric, Glossy, Lobe, LobeNumbers, LobeQuery, ThinDielectric,
};
use crate::math::{DVec3, Rgb, Vec3, luminance};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::{PI, TAU};

/// A film on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Share of the surface that the film covers, in [0, 1].
    pub weight: f32,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Thickness in nanometres.
    pub thickness: f32,
}

/// Gaussian fits to the sensitivities x, y and z over the wave number in 1/m: height, position and half the variance.
/// The fourth row is the second lobe of x (Belcour and Barla).
const EYE: [[f64; 3]; 4] = [
    [5.4856e-13, 1.6810e6, 4.3278e9],
    [4.4201e-13, 1.7953e6, 9.3046e9],
    [5.2481e-13, 2.2084e6, 6.6121e9],
    [9.7470e-14, 2.2399e6, 4.5282e9],
];

/// Integral of the sensitivity y.
const EYE_Y: f64 = 1.0685e-7;

/// Sensitivities x, y and z to cos(2π `path` k + `shift`) over wave numbers k, with the optical path difference `path`
/// in metres; in units of y's integral.
fn sensitivity(path: f64, shift: f64) -> DVec3 {
    let phase = TAU * path;
    let lobe = |[height, position, variance]: [f64; 3]| {
        let wave = (position * phase + shift).cos() * (-variance * phase * phase).exp();
        height * (TAU * variance).sqrt() * wave / EYE_Y
    };
    DVec3::new(lobe(EYE[0]) + lobe(EYE[3]), lobe(EYE[1]), lobe(EYE[2]))
}

/// Linear Rec. 709 of XYZ.
fn rec709(xyz: DVec3) -> DVec3 {
    DVec3::new(
        xyz.dot(DVec3::new(3.240_454_2, -1.537_138_5, -0.498_531_4)),
        xyz.dot(DVec3::new(-0.969_266_0, 1.876_010_8, 0.041_556_0)),
        xyz.dot(DVec3::new(0.055_643_4, -0.204_025_9, 1.057_225_2)),
    )
}

/// Reflectance at normal incidence between two indices.
fn f0_of(a: f64, b: f64) -> f64 {
    ((a - b) / (a + b)).powi(2)
}

fn schlick_of(f0: f64, cos: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cos).powi(5)
}

/// Optics of a film over a base: reflectances of both interfaces, the phase shifts there, and the difference of the
/// optical paths.
struct Interference {
    /// Reflectances of the upper interface and of the lower.
    reflectance: [f64; 2],
    shift: f64,
    path: f64,
}

impl Film {
    /// Optics for the cosine of incidence `cos` and a base of reflectance `f0`; `None` if light cannot enter the film.
    fn interference(&self, f0: f64, cos: f64) -> Option<Interference> {
        // A film that vanishes has the index of air.
        let t = (f64::from(self.thickness) / 0.03).clamp(0.0, 1.0);
        let ior = 1.0 + (f64::from(self.ior) - 1.0) * t * t * (3.0 - 2.0 * t);
        let cos2 = 1.0 - (1.0 - cos * cos) / (ior * ior);
        if cos2 < 0.0 {
            return None;
        }
        let inside = cos2.sqrt();
        let root = f0.clamp(0.0, 0.9999).sqrt();
        let base = (1.0 + root) / (1.0 - root);
        let upper = schlick_of(f0_of(ior, 1.0), cos);
        let lower = schlick_of(f0_of(base, ior), inside);
        // Inside the film only a denser base shifts the phase, by π; the sum of 2π otherwise is no shift.
        let turned = if base < ior { PI } else { 0.0 };
        Some(Interference {
            reflectance: [upper, lower],
            shift: PI + turned,
            path: 2e-9 * ior * f64::from(self.thickness) * inside,
        })
    }

    /// Reflectance in linear Rec. 709 of the film on a base of reflectance `f0` at normal incidence: a spectral mean
    /// plus interference by the eye's sensitivities. For coloured bases only the channel of `f0` is valid.
    fn rgb(&self, f0: f64, cos: f64) -> DVec3 {
        let Some(Interference {
            reflectance: [upper, lower],
            shift,
            path,
        }) = self.interference(f0, cos)
        else {
            return DVec3::ONE;
        };
        let both = (upper * lower).clamp(1e-5, 0.9999);
        let passed = 1.0 - upper;
        let returned = passed * passed * lower / (1.0 - both);
        let mut waves = DVec3::ZERO;
        let mut factor = returned - passed;
        for m in 1..=4 {
            factor *= both.sqrt();
            let m = f64::from(m);
            waves += 2.0 * factor * sensitivity(m * path, m * shift);
        }
        DVec3::splat(upper + returned) + rec709(waves)
    }

    /// Reflectance in [0, 1] of the surface with its film, for a base that reflects `f0` at normal incidence and
    /// `plain` at `cos`, the cosine between a direction and the half vector.
    pub(crate) fn reflectance(&self, f0: Rgb, plain: Rgb, cos: f32) -> Rgb {
        let cos = f64::from(cos.clamp(0.0, 1.0));
        let of = |c: usize| self.rgb(f0[c].into(), cos)[c];
        let film = match f0.x == f0.y && f0.y == f0.z {
            true => self.rgb(f0.x.into(), cos),
            false => DVec3::new(of(0), of(1), of(2)),
        };
        let film = film.clamp(DVec3::ZERO, DVec3::ONE).as_vec3();
        plain + (film - plain) * self.weight
    }
}

/// A surface under a film.
#[derive(Clone, Copy, Debug)]
pub struct Iridescent {
    under: Under,
    film: Film,
}

/// Surface under the film.
#[derive(Clone, Copy, Debug)]
enum Under {
    Glossy(Glossy),
    Dielectric(Dielectric),
    Thin(ThinDielectric),
}

/// The BSDF of a surface under a film; other kinds of BSDFs stay as they are.
pub fn iridescent(base: super::Bsdf, film: Film) -> super::Bsdf {
    use super::Bsdf;
    let under = match base {
        _ if film.weight == 0.0 => return base,
        Bsdf::Glossy(l) => Under::Glossy(l),
        Bsdf::Dielectric(l) if !super::is_matched(l.eta) => Under::Dielectric(l),
        Bsdf::Thin(l) => Under::Thin(l),
        other => return other,
    };
    Bsdf::Iridescent(Iridescent { under, film })
}

impl Iridescent {
    /// The surface without its film.
    pub(crate) fn base(&self) -> super::Bsdf {
        use super::Bsdf;
        match self.under {
            Under::Glossy(l) => Bsdf::Glossy(l),
            Under::Dielectric(l) => Bsdf::Dielectric(l),
            Under::Thin(l) => Bsdf::Thin(l),
        }
    }

    /// The surface without its diffuse lobe.
    pub(super) fn without_diffuse(self) -> Self {
        match self.under {
            Under::Glossy(l) => Self {
                under: Under::Glossy(Glossy {
                    albedo: Rgb::ZERO,
                    ..l
                }),
                ..self
            },
            _ => self,
        }
    }

    /// The interface of a solid body under the film.
    pub(super) fn dielectric_mut(&mut self) -> Option<&mut Dielectric> {
        match &mut self.under {
            Under::Dielectric(l) => Some(l),
            _ => None,
        }
    }

    /// Reflectance with the film, and without it, at a half vector whose cosine with a direction is `cos`. `eta` is the
    /// index of the other side over that of the direction's side.
    fn reflectances(&self, cos: f32, eta: f32) -> [Rgb; 2] {
        match self.under {
            Under::Glossy(Glossy { f0, f90, .. }) | Under::Thin(ThinDielectric { f0, f90, .. }) => {
                let plain = schlick(f0, f90, cos);
                [self.film.reflectance(f0, plain, cos), plain]
            }
            Under::Dielectric(_) => {
                let plain = Rgb::splat(dielectric(cos, eta));
                // From inside, the film reflects as from outside at the refracted angle.
                let beyond = 1.0 - (1.0 - cos * cos) / (eta * eta);
                let outer = match eta >= 1.0 {
                    true => cos,
                    false if beyond <= 0.0 => return [plain; 2],
                    false => beyond.sqrt(),
                };
                let r = (eta - 1.0) / (eta + 1.0);
                [
                    self.film.reflectance(Rgb::splat(r * r), plain, outer),
                    plain,
                ]
            }
        }
    }

    /// Index of the other side over the index on the side of `wo`.
    fn eta(&self, wo: Vec3) -> f32 {
        match self.under {
            Under::Dielectric(l) if wo.z > 0.0 => l.eta,
            Under::Dielectric(l) => 1.0 / l.eta,
            _ => 1.0,
        }
    }

    /// |wo·h| of the half vector of reflection or refraction. In reflection it is computed as |wo + wi|/2, which is
    /// symmetric in both directions to the last bit: the film's phase amplifies rounding errors.
    fn cos(&self, wo: Vec3, wi: Vec3) -> f32 {
        let cos = match self.under {
            Under::Thin(_) => 0.5 * (wo + wi.with_z(wi.z.abs().copysign(wo.z))).length(),
            Under::Dielectric(_) if wo.z * wi.z < 0.0 => {
                let h = wo + self.eta(wo) * wi;
                (wo.dot(h) / h.length()).abs()
            }
            _ => 0.5 * (wo + wi).length(),
        };
        cos.min(1.0)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let mut query = self.base().query(wo, wi)?;
        let [film, plain] = self.reflectances(self.cos(wo, wi), self.eta(wo));
        let plane = 0.25 / wo.z.abs();
        let through = wo.z * wi.z < 0.0;
        if let Under::Glossy(glossy) = self.under {
            query.scale = film * plane;
            if glossy.albedo != Rgb::ZERO {
                // The larger of both reflectances, as under a clear coat: it is reciprocal and gains no energy.
                let [o, i] = [wo, wi].map(|w| self.reflectances(w.z.abs().min(1.0), 1.0)[0]);
                query.base = glossy.albedo * (Rgb::ONE - o.max(i)) * (wi.z.abs() * FRAC_1_PI);
            }
            return Some(query);
        }
        // Selected by the film's reflectance, because the base's own may be 0.
        let chance = luminance(film);
        if !through {
            (query.scale, query.pdf_scale) = (film * plane, chance * plane);
            return Some(query);
        }
        let (passes, rest) = (Rgb::ONE - film, 1.0 - chance);
        match self.under {
            Under::Thin(thin) => {
                (query.scale, query.pdf_scale) = (passes * thin.tint * plane, rest * plane);
            }
            _ => {
                let passed = (1.0 - plain.x).max(1e-6);
                query.scale *= passes / passed;
                query.pdf_scale *= rest / passed;
            }
        }
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
        let distribution = match self.under {
            Under::Glossy(_) => return self.base().direction(alpha, wo, u),
            Under::Dielectric(l) => l.distribution,
            Under::Thin(l) => l.distribution,
        };
        let up = above(wo.z, wo);
        if up.z <= 0.0 {
            return None;
        }
        let [choice, x, y] = u.uniform();
        let h = distribution.sample_visible(alpha, up, u).normalize();
        let cos = up.dot(h).clamp(0.0, 1.0);
        let reflects = choice < luminance(self.reflectances(cos, self.eta(wo))[0]);
        if let Under::Thin(_) = self.under {
            let wi = mirror(up, h);
            let (z, lobe) = match reflects {
                true => (wi.z, Lobe::Reflection),
                false => (-wi.z, Lobe::Transmission),
            };
            return (wi.z > 0.0).then(|| (above(wo.z, wi.with_z(z)), lobe));
        }
        let choice = if reflects {
            0.0
        } else {
            1.0 - 0.5 * f32::EPSILON
        };
        self.base().direction(alpha, wo, [choice, x, y])
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
        if alpha >= DELTA_ALPHA || lobe == Lobe::Diffuse {
            return finish(self.query(wo, wi), alpha, wi, lobe);
        }
        let mut sample = self.base().sample_along(alpha, wo, wi, lobe)?;
        let cos = wo.z.abs().min(1.0);
        let [film, _] = self.reflectances(cos, self.eta(wo));
        let chance = luminance(film);
        sample.weight = match (self.under, lobe) {
            (Under::Glossy(l), _) => film / l.glossy_probability(cos),
            (_, Lobe::Reflection) => film / chance,
            (Under::Thin(l), _) => (Rgb::ONE - film) * l.tint / (1.0 - chance),
            // The base's weight is already divided by its selection probability.
            _ => sample.weight * (Rgb::ONE - film) / (1.0 - chance),
        };
        sample.weight.is_finite().then_some(sample)
    }
}

#[cfg(test)]
mod tests;
