//! Microfacet slope distributions: density, masking, and sampling of visible normals.
//!
//! Everything is written in slopes and tangents: single precision then holds from α = 1e-3 to 1 and up to grazing
//! angles, where forms with `1 − cos²` lose every digit.

use crate::math::Vec3;
use crate::math::real::{Real, erf_inverse, scaled_erfc};
use std::f32::consts::PI;

/// Which microfacet slope distribution a glossy lobe has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Distribution {
    /// Gaussian slopes: what the tables are learned for.
    #[default]
    Beckmann,
    /// Trowbridge-Reitz, glTF's own model.
    Ggx,
}

/// Largest exponent of a Gaussian that is not cut to zero: beyond it D is 1e-35, and α's derivative would overflow.
const CUT: f64 = 80.0;

impl Distribution {
    /// Density of normals D(θ_h), per steradian, as a function of α and t = tan² θ_h `[Walter07 (25), (33)]`.
    #[inline]
    pub fn d<T: Real>(self, alpha: T, tan2_h: f32) -> T {
        let t = T::constant(tan2_h);
        let a2 = alpha * alpha;
        let x = t / a2;
        let one = T::constant(1.0);
        match self {
            // Written so that an x that is not a number is cut as well.
            Self::Beckmann if x.value() < CUT => {
                // cos⁻⁴ = (1 + t)².
                (-x).exp() * (one + t) * (one + t) / (T::constant(PI) * a2)
            }
            Self::Beckmann => T::constant(0.0),
            Self::Ggx if x.value() < f64::INFINITY => {
                // The square last: (1 + t)² alone overflows where both directions graze.
                let b = (one + t) / (one + x);
                b * b / (T::constant(PI) * a2)
            }
            Self::Ggx => T::constant(0.0),
        }
    }

    /// Smith's Λ of a direction, as a function of α and tan² θ `[Heitz14 (A.9), (72)]`.
    #[inline]
    pub fn lambda<T: Real>(self, alpha: T, tan2: f32) -> T {
        if tan2 == 0.0 {
            return T::constant(0.0);
        }
        // At the horizon the tangent is infinite, and a derivative would be 0 · ∞.
        let tan2 = tan2.min(1e30);
        match self {
            Self::Beckmann => {
                let a = T::constant(1.0) / (alpha * T::constant(tan2.sqrt()));
                a.beckmann_lambda()
            }
            Self::Ggx => {
                // (√(1 + x) − 1)/2 with x = α² tan² θ, without the difference of near equals.
                let x = alpha * alpha * T::constant(tan2);
                let one = T::constant(1.0);
                x / (T::constant(2.0) * (one + (one + x).sqrt()))
            }
        }
    }

    /// Draws a visible normal for `wo` (`wo.z` > 0): density D(h) G1(wo) max(0, wo·h) / cos θ_o per steradian
    /// `[HeitzDEon14]`. Not normalised: `z` is 1, so that tiny slopes keep their digits.
    #[inline]
    pub fn sample_visible(self, alpha: f32, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let stretched = Vec3::new(alpha * wo.x, alpha * wo.y, wo.z);
        let sin = stretched.truncate().length();
        let (cos_phi, sin_phi) = if sin > 0.0 {
            (stretched.x / sin, stretched.y / sin)
        } else {
            (1.0, 0.0)
        };
        let tan = sin / stretched.z;
        let (x, y) = match self {
            Self::Beckmann => (
                beckmann_slope(tan, u[0]),
                erf_inverse(2.0 * open(u[1]) - 1.0),
            ),
            Self::Ggx => return ggx_normal(stretched, alpha, u),
        };
        // Slopes of the normal are minus its tangent coordinates.
        let (sx, sy) = (cos_phi * x - sin_phi * y, sin_phi * x + cos_phi * y);
        Vec3::new(-alpha * sx, -alpha * sy, 1.0)
    }
}

/// A uniform number moved off 0 and 1, where the Gaussian's quantiles are infinite.
#[inline]
fn open(u: f32) -> f32 {
    u.clamp(3e-8, 1.0 - 6e-8)
}

/// Slope along the plane of incidence, for unit roughness and an incidence of this tangent.
///
/// Solves F(x) = u F(cot θ) on x ≤ cot θ, with F(x) = (1 + erf x)/2 + tan θ e^(−x²)/(2√π) the integral of
/// (1 − x tan θ) e^(−x²)/√π `[HeitzDEon14 §4.1]`, by Halley's steps inside a bracket: they cube the error, so that one
/// or two are enough.
#[inline]
fn beckmann_slope(tan: f32, u: f32) -> f32 {
    const INV_SQRT_PI: f32 = 0.564_189_6;
    /// A step so short, relative to 1 + |x|, leaves an error below single precision.
    const LAST_STEP: f32 = 1e-3;
    let u = open(u);
    let normal = erf_inverse(2.0 * u - 1.0);
    if tan < 1e-4 {
        return normal;
    }
    let cot = 1.0 / tan;
    let (mut low, mut high) = (-6.0f32, cot.min(6.0));
    let half_tan = 0.5 * tan * INV_SQRT_PI;
    let lambda = cot.beckmann_lambda();
    let target = u * (1.0 + lambda);
    // F″/F′ = −tan θ/(1 − x tan θ) − 2x.
    let step = |x: f32, error: f32, gauss: f32| {
        let visible = 1.0 - x * tan;
        let newton = error / (visible * gauss * INV_SQRT_PI);
        newton / (1.0 + 0.5 * newton * (tan / visible + 2.0 * x)).clamp(0.5, 2.0)
    };
    let first = if tan < 0.7 {
        // At the quantile of normal incidence erf x is 2u − 1: a step without it.
        let gauss = (-normal * normal).exp();
        normal - step(normal, half_tan * gauss - u * lambda, gauss)
    } else {
        // From the quantile at normal incidence to the one at grazing incidence, where F is proportional to e^(−x²).
        let grazing = -(-u.ln()).sqrt();
        normal + (grazing - normal) * tan / (1.0 + tan)
    };
    let mut x = first.clamp(low, high);
    for _ in 0..12 {
        let gauss = (-x * x).exp();
        let erf = (1.0 - gauss * scaled_erfc(x.abs())).copysign(x);
        let error = 0.5 * (1.0 + erf) + half_tan * gauss - target;
        // Before the bracket is narrowed to x itself: a step of nothing must not be taken for one outside.
        if error.abs() < 1e-7 * (1.0 + lambda) {
            break;
        }
        if error > 0.0 {
            high = x
        } else {
            low = x
        }
        let next = x - step(x, error, gauss);
        // Outside the bracket (or nowhere, where the density vanishes) the step is halving.
        let next = if next >= low && next <= high {
            next
        } else {
            0.5 * (low + high)
        };
        let moved = (next - x).abs();
        x = next;
        if moved < LAST_STEP * (1.0 + x.abs()) {
            break;
        }
    }
    x
}

/// Visible normal of GGX by projecting a uniform point of the spherical cap (Dupuy, Benyoub: *Sampling Visible GGX
/// Normals with Spherical Caps*, 2023). `z` of the result is 1.
#[inline]
fn ggx_normal(stretched: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let wo = stretched.normalize();
    let phi = 2.0 * PI * u[0];
    // z uniform in (−wo.z, 1].
    let z = 1.0 - u[1] * (1.0 + wo.z);
    let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    let cap = Vec3::new(r * phi.cos(), r * phi.sin(), z);
    let h = cap + wo;
    Vec3::new(alpha * h.x, alpha * h.y, h.z.max(1e-20)) / h.z.max(1e-20)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::real::erf_f64;

    #[test]
    fn normals_on_the_horizon_and_nowhere_have_no_density() {
        for distribution in [Distribution::Beckmann, Distribution::Ggx] {
            for alpha in [1e-3f32, 0.1, 1.0] {
                for tan2 in [f32::INFINITY, f32::NAN] {
                    assert_eq!(distribution.d(alpha, tan2), 0.0, "{distribution:?} {alpha}");
                }
                let steep = distribution.d(alpha, f32::MAX);
                assert!(
                    steep.is_finite() && steep >= 0.0,
                    "{distribution:?} {steep}"
                );
                let grazing = distribution.lambda(alpha, f32::INFINITY);
                assert!(grazing.is_finite() && grazing > 1e10, "{grazing}");
                assert_eq!(distribution.lambda(alpha, 0.0), 0.0);
            }
        }
    }

    #[test]
    fn every_pair_of_numbers_gives_a_normal() {
        let ends = [0.0, f32::MIN_POSITIVE, 1e-8, 0.5, 1.0 - 6e-8, 1.0];
        for distribution in [Distribution::Beckmann, Distribution::Ggx] {
            for wo in [
                Vec3::Z,
                Vec3::new(0.6, -0.48, 0.64),
                Vec3::new(1.0, 0.0, 1e-6),
            ] {
                for u in ends.iter().flat_map(|&u| ends.map(|v| [u, v])) {
                    let h = distribution.sample_visible(0.5, wo.normalize(), u);
                    assert!(h.is_finite(), "{distribution:?} {wo} {u:?}: {h}");
                }
            }
        }
    }

    /// F of [`beckmann_slope`] in double precision.
    fn integral(x: f64, tan: f64) -> f64 {
        0.5 * (1.0 + erf_f64(x)) + 0.5 * tan * (-x * x).exp() / std::f64::consts::PI.sqrt()
    }

    #[test]
    fn slopes_invert_their_integral() {
        let mut worst = 0.0f64;
        for exponent in -40..=60 {
            let tan = 10f32.powf(exponent as f32 * 0.1);
            let whole = integral(1.0 / f64::from(tan), tan.into());
            for i in 0..=2000 {
                // Evenly, and crowded towards both ends.
                let t = i as f32 / 2000.0;
                for u in [t, 1e-4 * t, 1.0 - 1e-4 * t] {
                    let x = beckmann_slope(tan, u);
                    assert!(x <= 1.0 / tan, "{tan} {u}: {x} is not visible");
                    let error = integral(x.into(), tan.into()) / whole - f64::from(open(u));
                    worst = worst.max(error.abs());
                }
            }
        }
        // erf is good to 1.5e-7, u to 6e-8.
        assert!(worst < 2e-6, "{worst:e}");
    }
}
