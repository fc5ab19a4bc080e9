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

/// Reflectance in [0, 1] of a smooth metal of index `eta` + i `k`, over that of this side, for unpolarised light: Fresnel's
/// equations for a complex index `[PBRT4 §9.3.6]`, in real numbers (Born, Wolf: *Principles of Optics*, §14.2). Exact also for
/// `k` = 0, where it is [`dielectric`].
pub fn conductor(cos: f32, eta: f32, k: f32) -> f32 {
    let cos2 = cos * cos;
    let sin2 = (1.0 - cos2).max(0.0);
    let (eta2, k2) = (eta * eta, k * k);
    // a + ib is the root of (η + ik)² − sin²θ.
    let real = eta2 - k2 - sin2;
    let modulus = (real * real + 4.0 * eta2 * k2).sqrt();
    let a = (0.5 * (modulus + real)).max(0.0).sqrt();
    let (t1, t2) = (modulus + cos2, 2.0 * cos * a);
    let s = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (cos2 * modulus + sin2 * sin2, t2 * sin2);
    let p = s * (t3 - t4) / (t3 + t4);
    let mean = 0.5 * (s + p);
    // 0/0 for the index of the outside itself.
    if mean.is_nan() {
        0.0
    } else {
        mean.clamp(0.0, 1.0)
    }
}

/// Cosine-weighted mean of [`dielectric`] over the hemisphere, 2 ∫₀¹ F(c) c dc, by Gauss's rule in pieces.
pub(crate) fn dielectric_average(eta: f32) -> f32 {
    const PIECES: u32 = 256;
    let mut sum = 0.0;
    for i in 0..PIECES {
        for offset in [0.211_324_865_4, 0.788_675_134_6] {
            let c = (f64::from(i) + offset) / f64::from(PIECES);
            sum += c * f64::from(dielectric(c as f32, eta));
        }
    }
    (sum / f64::from(PIECES)) as f32
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

    /// Against the equations in complex numbers: r_s = (cos θ − w)/(cos θ + w), r_p = (n² cos θ − w)/(n² cos θ + w) with
    /// w² = n² − sin² θ.
    #[test]
    fn conductor_is_fresnel_of_a_complex_index() {
        type Complex = (f64, f64);
        let mul = |a: Complex, b: Complex| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let norm = |a: Complex| a.0 * a.0 + a.1 * a.1;
        let root = |a: Complex| {
            let (r, phi) = (norm(a).sqrt().sqrt(), 0.5 * a.1.atan2(a.0));
            (r * phi.cos(), r * phi.sin())
        };
        let mut seen = 0;
        for (eta, k) in [
            (0.2, 3.91),
            (1.1, 2.14),
            (1.5, 0.0),
            (2.74, 3.79),
            (0.04, 0.1),
        ] {
            for i in 0..=50 {
                let cos = f64::from(i) / 50.0;
                let n2 = mul((eta, k), (eta, k));
                let w = root((n2.0 - (1.0 - cos * cos), n2.1));
                let ratio =
                    |a: Complex| norm((a.0 - w.0, a.1 - w.1)) / norm((a.0 + w.0, a.1 + w.1));
                let expected = 0.5 * (ratio((cos, 0.0)) + ratio((n2.0 * cos, n2.1 * cos)));
                let found = f64::from(conductor(cos as f32, eta as f32, k as f32));
                assert!(
                    (found - expected).abs() < 2e-5,
                    "{eta} {k} {cos}: {found} {expected}"
                );
                if k == 0.0 {
                    let plain = f64::from(dielectric(cos as f32, eta as f32));
                    assert!((found - plain).abs() < 2e-5, "{cos}");
                }
                seen += 1;
            }
        }
        assert_eq!(seen, 255);
        assert_eq!(conductor(0.5, 1.0, 0.0), 0.0);
    }

    /// Against the closed form of the mean (Duntley 1942, as in d'Eon's and Irving's *A Quantized-Diffusion Model*, 2011).
    #[test]
    fn dielectric_average_matches_known_values() {
        for (eta, known) in [(1.0f32, 0.0), (1.5, 0.091_8), (1.333, 0.065_9)] {
            let found = f64::from(dielectric_average(eta));
            assert!((found - known).abs() < 2e-3, "{eta}: {found}");
        }
        // From inside: 1 − (1 − F)/η².
        let (out, inside) = (dielectric_average(1.5), dielectric_average(1.0 / 1.5));
        assert!(
            (inside - (1.0 - (1.0 - out) / 2.25)).abs() < 1e-3,
            "{inside}"
        );
    }
}
