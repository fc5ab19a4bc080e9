//! Sheen of cloth `[KHR_materials_sheen]`: distribution and shadowing of Estevez and Kulla, *Production Friendly
//! Microfacet Sheen BRDF*, 2017.
//!
//! The lobe is so wide that regularisation treats it as diffuse.

use super::lobes::{NO_LOBE, above};
use super::{BsdfSample, Lobe, LobeQuery};
use crate::math::{Rgb, Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::LazyLock;

/// Least roughness: the lobe of a smaller one is a rim too thin for a picture.
const MIN_ALPHA: f32 = 0.01;

/// Densities of normals below this count as 0: values would be denormal numbers, which keep few digits.
const NO_FIBRE: f32 = 1e-20;

/// Fibres on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// Reflectance of the fibres in [0, 1], over the lobe's selection probability.
    pub color: Rgb,
    /// Roughness in [0, 1].
    pub alpha: f32,
}

/// Density of the normals of fibres at this sine.
fn distribution(alpha: f32, sin: f32) -> f32 {
    let inverse = 1.0 / alpha;
    let d = (2.0 + inverse) * sin.powf(inverse) * (0.5 * FRAC_1_PI);
    if d < NO_FIBRE { 0.0 } else { d }
}

/// Λ of masking and shadowing, by the authors' fit.
fn lambda(alpha: f32, cos: f32) -> f32 {
    let smooth = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f32, fine: f32| rough + smooth * (fine - rough);
    let [a, b, c, d, e] = [
        mix(21.5473, 25.3245),
        mix(3.82987, 3.32435),
        mix(0.19823, 0.16801),
        mix(-1.97760, -1.27393),
        mix(-4.32054, -4.85967),
    ];
    let fit = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 {
        fit(cos).exp()
    } else {
        (2.0 * fit(0.5) - fit(1.0 - cos)).exp()
    }
}

/// f cos θi of white fibres, both directions above the surface.
fn reflected(alpha: f32, wo: Vec3, wi: Vec3) -> f32 {
    let alpha = alpha.max(MIN_ALPHA);
    let h = (wo + wi).normalize_or_zero();
    let sin = h.x.hypot(h.y).min(1.0);
    let shadow = 1.0 + lambda(alpha, wo.z) + lambda(alpha, wi.z);
    // The same bound of both cosines keeps the lobe reciprocal.
    let cosines = wo.z.max(1e-4) * wi.z.max(1e-4);
    distribution(alpha, sin) * wi.z / (4.0 * cosines * shadow)
}

impl Sheen {
    /// No fibres.
    pub(crate) const NONE: Self = Self {
        color: Rgb::ZERO,
        alpha: 0.0,
    };

    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        (wo.z > 0.0 && wi.z > 0.0).then(|| LobeQuery {
            base: self.color * reflected(self.alpha, wo, wi),
            base_pdf: 1.0 / TAU,
            ..NO_LOBE
        })
    }

    /// A direction, uniform over the hemisphere: the lobe is widest near the horizon.
    pub(super) fn direction(&self, wo: Vec3, u: [f32; 3]) -> Option<(Vec3, Lobe)> {
        let (z, turn) = (1.0 - u[1], Vec2::from_angle(TAU * u[2]));
        let flat = turn * (1.0 - z * z).max(0.0).sqrt();
        (wo.z != 0.0).then(|| (above(wo.z, flat.extend(z)), Lobe::Diffuse))
    }

    pub(super) fn sample_along(&self, wo: Vec3, wi: Vec3) -> Option<BsdfSample> {
        let query = self.query(wo, wi)?;
        Some(BsdfSample {
            wi,
            value: query.base,
            weight: query.base / query.base_pdf,
            pdf_w: query.base_pdf,
            lobe: Lobe::Diffuse,
            delta: false,
        })
    }
}

/// Steps of cosine and of the root of the roughness in [`ALBEDO`].
const STEPS: usize = 24;

/// Reflectance of white fibres by root of the roughness and cosine.
static ALBEDO: LazyLock<Vec<[f32; STEPS]>> = LazyLock::new(|| {
    let at = |i: usize| i as f32 / (STEPS - 1) as f32;
    let row = |j: usize| std::array::from_fn(|i| integrated(at(j) * at(j), at(i), [24, 32]));
    (0..STEPS).map(row).collect()
});

/// The integral of [`reflected`] over the directions of light, at most 1, by the midpoint rule.
fn integrated(alpha: f32, cos: f32, [heights, turns]: [u32; 2]) -> f32 {
    let cos = cos.max(1e-3);
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0f64;
    for i in 0..heights {
        let z = (i as f32 + 0.5) / heights as f32;
        for k in 0..turns {
            let turn = Vec2::from_angle(TAU * 0.5 * (k as f32 + 0.5) / turns as f32);
            let wi = (turn * (1.0 - z * z).sqrt()).extend(z);
            sum += f64::from(reflected(alpha, wo, wi));
        }
    }
    (sum * f64::from(TAU) / f64::from(heights * turns)).min(1.0) as f32
}

/// Reflectance in [0, 1] of white fibres of this roughness at a cosine of incidence.
pub(crate) fn sheen_albedo(alpha: f32, cos: f32) -> f32 {
    let table = &*ALBEDO;
    let place = |x: f32| {
        let x = x.clamp(0.0, 1.0) * (STEPS - 1) as f32;
        let i = (x as usize).min(STEPS - 2);
        (i, x - i as f32)
    };
    let ((j, v), (i, u)) = (place(alpha.sqrt()), place(cos));
    let row = |j: usize| table[j][i] + u * (table[j][i + 1] - table[j][i]);
    row(j) + v * (row(j + 1) - row(j))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ D cos θ dω = 1 over the hemisphere.
    #[test]
    fn sheen_normals_are_normalised() {
        for alpha in [0.05, 0.3, 1.0] {
            let n = 20_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let cos = (f64::from(i) + 0.5) / f64::from(n);
                    let sin = (1.0 - cos * cos).sqrt() as f32;
                    f64::from(TAU * distribution(alpha, sin)) * cos / f64::from(n)
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-3, "{alpha}: {sum}");
        }
    }

    #[test]
    fn sheen_albedo_is_its_integral_and_makes_no_light() {
        for alpha in [0.02f32, 0.1, 0.25, 0.6, 1.0] {
            for cos in [0.05, 0.3, 0.55, 0.8, 1.0] {
                let (table, fine) = (sheen_albedo(alpha, cos), integrated(alpha, cos, [200, 200]));
                assert!((table - fine).abs() < 0.02, "{alpha} {cos}: {table} {fine}");
                assert!((0.0..=1.0).contains(&table));
            }
        }
    }
}
