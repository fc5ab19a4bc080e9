//! Microfacet distributions: density D, Smith's masking function Λ, and sampling of visible normals.
//!
//! All formulas use microfacet slopes and tangents of angles. They keep their digits in single precision from α = 1e-3
//! to 1 and up to grazing angles, where formulas with `1 − cos²` lose every digit.

use super::LobeNumbers;
use super::slope::visible_slope;
use crate::math::Vec3;
use crate::math::real::{Dual, Real, SQRT_PI, scaled_erfc};
use std::f32::consts::PI;

/// Roughness below which a lobe is a Dirac delta: single precision cannot evaluate a sharper one at grazing angles.
pub const DELTA_ALPHA: f32 = 1e-3;

/// Distribution of microfacet slopes of a glossy lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[repr(u8)]
pub enum Distribution {
    /// Gaussian slopes, the distribution that the shipped tables are learned for.
    #[default]
    Beckmann,
    /// Trowbridge-Reitz, the distribution of glTF.
    Ggx,
    /// Not of slopes: Henyey and Greenstein's [phase function](super::Phase) of mean cosine ±(1 − α).
    #[cfg_attr(feature = "clap", value(skip))]
    HenyeyGreenstein,
}

/// Largest exponent x of e^(−x) in Beckmann's D. Beyond it e^(−x) is below 2e-35 and D is set to 0, because its
/// derivative in α would overflow.
const CUT: f64 = 80.0;

/// Largest argument of Beckmann's Λ that is not set to 0: Λ is below 1e-9 beyond it.
const LAMBDA_END: f64 = 4.2;

/// Real number that a microfacet lobe can be evaluated in.
pub trait LobeReal: Real {
    /// Smith's Λ of the Beckmann distribution `[Heitz14 (A.9)]` as a function of a = 1/(α tan θ) > 0:
    /// (erf a − 1)/2 + e^(−a²)/(2 a √π), and 0 where it is below 1e-9.
    fn beckmann_lambda(self) -> Self;
}

impl LobeReal for f32 {
    #[inline]
    fn beckmann_lambda(self) -> Self {
        if self > LAMBDA_END as f32 {
            return 0.0;
        }
        // Both terms share one exponential.
        0.5 * (-self * self).exp() * (1.0 / (self * SQRT_PI as f32) - scaled_erfc(self))
    }
}

impl LobeReal for f64 {
    fn beckmann_lambda(self) -> Self {
        if self > LAMBDA_END {
            return 0.0;
        }
        -0.5 * libm::erfc(self) + (-self * self).exp() / (2.0 * self * SQRT_PI)
    }
}

impl<F: Real> LobeReal for Dual<F> {
    #[inline]
    fn beckmann_lambda(self) -> Self {
        let a = self.v;
        if a.value() > LAMBDA_END {
            return Self::constant(0.0);
        }
        // The value has an error of 1e-7; the derivative is exact: dΛ/da = −e^(−a²) / (2 a² √π).
        let gauss = (-a * a).exp();
        // √π as a sum of two singles, to the digits of either precision.
        let high = SQRT_PI as f32;
        let low = (SQRT_PI - f64::from(high)) as f32;
        let sqrt_pi = F::constant(high) + F::constant(low);
        let part = gauss / (F::constant(2.0) * a * sqrt_pi);
        let erfc = F::constant(scaled_erfc(a.value() as f32));
        Self {
            v: part - F::constant(0.5) * gauss * erfc,
            d: -self.d * part / a,
        }
    }
}

impl Distribution {
    /// Density of microfacet normals D(θ_h) per steradian, for α > 0 and `tan2_h` = tan² θ_h `[Walter07 (25), (33)]`.
    /// Finite and at least 0 for every tangent, 0 at the horizon. For a phase function, its value at twice the angle
    /// θ_h.
    #[inline]
    pub(crate) fn d<T: Real>(self, alpha: T, tan2_h: f32) -> T {
        let t = T::constant(tan2_h);
        let a2 = alpha * alpha;
        let x = t / a2;
        let one = T::constant(1.0);
        match self {
            // This comparison also sends NaN to the arm below.
            Self::Beckmann if x.value() < CUT => {
                // cos⁻⁴ = (1 + t)².
                (-x).exp() * (one + t) * (one + t) / (T::constant(PI) * a2)
            }
            Self::Beckmann => T::constant(0.0),
            Self::Ggx if x.value() < f64::INFINITY => {
                // Squared last: (1 + t)² alone overflows if both directions graze.
                let b = (one + t) / (one + x);
                b * b / (T::constant(PI) * a2)
            }
            Self::Ggx => T::constant(0.0),
            Self::HenyeyGreenstein => {
                // (1 − g²) / (4π (1 + g² − 2 g cos θ)^(3/2)) by α = 1 − g and 1 − cos θ.
                let off = T::constant(2.0 / (1.0 + 1.0 / tan2_h));
                let two = T::constant(2.0);
                let b = a2 + two * (one - alpha) * off;
                alpha * (two - alpha) / (T::constant(4.0 * PI) * b * b.sqrt())
            }
        }
    }

    /// Smith's masking function Λ ≥ 0 of a direction, for α > 0 and `tan2` = tan² θ
    /// `[Heitz14 (A.9), (72)]`; G1 = 1/(1 + Λ).
    #[inline]
    pub(crate) fn lambda<T: LobeReal>(self, alpha: T, tan2: f32) -> T {
        if tan2 == 0.0 {
            return T::constant(0.0);
        }
        // The tangent is infinite at the horizon, where a derivative would be 0 · ∞.
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
            // A point of a medium has no masking.
            Self::HenyeyGreenstein => T::constant(0.0),
        }
    }

    /// Samples a normal visible from `wo`, `wo.z` > 0, with density D(h) G1(wo) max(0, wo·h) / cos θ_o per steradian
    /// `[HeitzDEon14 (2)]`; the surface normal for a Dirac lobe. Only the last two of the numbers `u` in [0, 1)³ are
    /// used. The result has `z` = 1 in place of unit length, so that small slopes keep their digits.
    #[inline]
    pub(crate) fn sample_visible(self, alpha: f32, wo: Vec3, u: impl LobeNumbers) -> Vec3 {
        if alpha < DELTA_ALPHA {
            return Vec3::Z;
        }
        let stretched = Vec3::new(alpha * wo.x, alpha * wo.y, wo.z);
        let quantiles = match self {
            Self::Beckmann => u.quantiles(),
            Self::Ggx => {
                let [_, u, v] = u.uniform();
                return ggx_normal(stretched, alpha, [u, v]);
            }
            Self::HenyeyGreenstein => return Vec3::Z,
        };
        let sin = stretched.truncate().length();
        let (cos_phi, sin_phi) = if sin > 0.0 {
            (stretched.x / sin, stretched.y / sin)
        } else {
            (1.0, 0.0)
        };
        // The slope in the plane of incidence, and the one across it.
        let x = visible_slope(sin / stretched.z, &quantiles);
        let y = quantiles.across;
        // Slopes of the normal are minus its tangent coordinates.
        let (sx, sy) = (cos_phi * x - sin_phi * y, sin_phi * x + cos_phi * y);
        Vec3::new(-alpha * sx, -alpha * sy, 1.0)
    }
}

/// Samples a visible normal of GGX by way of a uniform point of a spherical cap (Dupuy, Benyoub: *Sampling Visible GGX
/// Normals with Spherical Caps*, 2023). The result has `z` = 1.
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
mod tests;
