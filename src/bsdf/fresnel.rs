//! Fresnel reflectance of an interface.

use crate::math::Rgb;

/// Reflectance in [0, 1] of a smooth dielectric interface for unpolarised light `[Walter07 (22)]`.
///
/// `cos` in [0, 1] is the cosine of incidence, `eta` the index of the other side over the index of this side. 1 under
/// total internal reflection. Accurate at grazing angles and for `eta` near 1, since nothing is subtracted from 1.
#[inline]
pub fn dielectric(cos: f32, eta: f32) -> f32 {
    // g² = η² − 1 + c², with η² − 1 factored so that it keeps its digits near 1.
    let g2 = (eta - 1.0) * (eta + 1.0) + cos * cos;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let (minus, plus) = (g - cos, g + cos);
    let a = minus / plus;
    let b = (cos * plus - 1.0) / (cos * minus + 1.0);
    (0.5 * a * a * (1.0 + b * b)).min(1.0)
}

/// Schlick's approximation f0 + (f90 − f0)(1 − cos)⁵ of the reflectance, with `f0` at normal and `f90` at grazing
/// incidence.
#[inline]
pub(crate) fn schlick(f0: Rgb, f90: f32, cos: f32) -> Rgb {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    f0 + (Rgb::splat(f90) - f0) * (m2 * m2 * m)
}

/// Cosine-weighted mean of [`schlick`] over the hemisphere: 2 ∫₀¹ F(c) c dc = f0 + (f90 − f0)/21.
#[inline]
pub(crate) fn schlick_average(f0: Rgb, f90: f32) -> Rgb {
    f0 + (Rgb::splat(f90) - f0) * (1.0 / 21.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectric_at_normal_incidence_brewster_and_beyond_the_critical_angle() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-7);
        assert!((dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-7);
        assert_eq!(dielectric(0.1, 1.0 / 1.5), 1.0);
        assert_eq!(dielectric(0.0, 1.5), 1.0);
        // At Brewster's angle only the s polarisation reflects: F = ½ ((1 − η²)/(1 + η²))².
        let eta: f32 = 1.5;
        let brewster = (1.0 / (1.0 + eta * eta)).sqrt();
        let s = (1.0 - eta * eta) / (1.0 + eta * eta);
        assert!((dielectric(brewster, eta) - 0.5 * s * s).abs() < 1e-6);
    }

    #[test]
    fn dielectric_of_equal_indices_does_not_reflect() {
        for i in 1..=100 {
            assert!(dielectric(i as f32 * 0.01, 1.0) < 1e-12);
        }
    }

    #[test]
    fn schlick_average_matches_its_integral() {
        let n = 100_000;
        let sum: f64 = (0..n)
            .map(|i| {
                let c = (f64::from(i) + 0.5) / f64::from(n);
                2.0 * c * f64::from(schlick(Rgb::splat(0.2), 0.7, c as f32).x) / f64::from(n)
            })
            .sum();
        assert!((sum - f64::from(schlick_average(Rgb::splat(0.2), 0.7).x)).abs() < 1e-6);
    }
}
