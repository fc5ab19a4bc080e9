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

/// Reflectance in [0, 1] of a smooth metal of index `eta` + i `k` relative to this side, for unpolarised light:
/// Fresnel's equations for a complex index `[PBRT4 §9.3.6]`, in real numbers (Born, Wolf: *Principles of Optics*,
/// §14.2). For `k` = 0 it equals [`dielectric`].
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
    // 0/0 if both sides have the same index.
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
mod tests;
