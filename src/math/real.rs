//! Number types in which a formula can be evaluated: `f32` to render, [`Dual`] to differentiate, `f64` to check. Also
//! the scaled complement and the inverse of the error function, in single precision.

use super::Vec4;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Real number with the elementary functions that BSDFs need.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Constant, with derivative 0.
    fn constant(x: f32) -> Self;
    /// Value without the derivative.
    fn value(self) -> f64;
    /// eˣ.
    fn exp(self) -> Self;
    /// √x, x ≥ 0.
    fn sqrt(self) -> Self;
}

/// √π.
pub(crate) const SQRT_PI: f64 = 1.772_453_850_905_516;

/// (1 − erf x) e^(x²) for x ≥ 0 by Abramowitz and Stegun 7.1.26; error of erf at most 1.5e-7.
#[inline]
pub(crate) fn scaled_erfc(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    t * (0.254_829_6
        + t * (-0.284_496_72 + t * (1.421_413_8 + t * (-1.453_152_1 + t * 1.061_405_4))))
}

/// Coefficients of [`erf_inverse`] for w < 5, highest first.
const CENTRE: [f32; 9] = [
    2.810_226_4e-8,
    3.432_739_4e-7,
    -3.523_387_7e-6,
    -4.391_506_5e-6,
    0.000_218_580_87,
    -0.001_253_725_1,
    -0.004_177_681_6,
    0.246_640_73,
    1.501_409_4,
];

/// Coefficients of [`erf_inverse`] for w ≥ 5, highest first.
const TAIL: [f32; 9] = [
    -0.000_200_214_26,
    0.000_100_950_56,
    0.001_349_343_2,
    -0.003_673_428_4,
    0.005_739_507_7,
    -0.007_622_461_3,
    0.009_438_870_5,
    1.001_674,
    2.832_976_8,
];

/// Inverse of erf on (−1, 1) in single precision, after Giles: *Approximating the erfinv function*, 2010. It takes two
/// numbers, since each step of a polynomial waits for the step before it.
#[inline]
pub(crate) fn erf_inverse([x, y]: [f32; 2]) -> [f32; 2] {
    let w = |x: f32| -((1.0 - x) * (1.0 + x)).ln();
    let (v, w) = (w(x), w(y));
    if v < 5.0 && w < 5.0 {
        let w = Vec4::new(v, w, v, w) - Vec4::splat(2.5);
        let p = (CENTRE[1..].iter()).fold(Vec4::splat(CENTRE[0]), |p, &c| p * w + Vec4::splat(c));
        return [p.x * x, p.y * y];
    }
    [erf_inverse_of(x, v), erf_inverse_of(y, w)]
}

/// Inverse of erf at x, with w = −ln(1 − x²).
#[cold]
fn erf_inverse_of(x: f32, w: f32) -> f32 {
    let (w, c) = if w < 5.0 {
        (w - 2.5, CENTRE)
    } else {
        (w.sqrt() - 3.0, TAIL)
    };
    x * c.into_iter().reduce(|p, c| p * w + c).unwrap_or_default()
}

impl Real for f32 {
    #[inline]
    fn constant(x: f32) -> Self {
        x
    }
    #[inline]
    fn value(self) -> f64 {
        self.into()
    }
    #[inline]
    fn exp(self) -> Self {
        f32::exp(self)
    }
    #[inline]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
}

impl Real for f64 {
    fn constant(x: f32) -> Self {
        x.into()
    }
    fn value(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

/// Dual number: a value with its derivative, for forward differentiation in one variable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<F = f64> {
    /// Value.
    pub v: F,
    /// Derivative.
    pub d: F,
}

impl<F: Real> Dual<F> {
    /// The variable of differentiation: derivative 1.
    #[inline]
    pub fn variable(v: F) -> Self {
        Self {
            v,
            d: F::constant(1.0),
        }
    }
}

impl Dual<f32> {
    /// Conversion to double precision.
    #[inline]
    pub fn wide(self) -> Dual {
        Dual {
            v: self.v.into(),
            d: self.d.into(),
        }
    }
}

impl<F: PartialOrd> PartialOrd for Dual<F> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        self.v.partial_cmp(&other.v)
    }
}

impl<F: Real> Add for Dual<F> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self {
            v: self.v + o.v,
            d: self.d + o.d,
        }
    }
}

impl<F: Real> Sub for Dual<F> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self {
            v: self.v - o.v,
            d: self.d - o.d,
        }
    }
}

impl<F: Real> Mul for Dual<F> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self {
            v: self.v * o.v,
            d: self.d * o.v + self.v * o.d,
        }
    }
}

impl<F: Real> Div for Dual<F> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let v = self.v / o.v;
        Self {
            v,
            d: (self.d - v * o.d) / o.v,
        }
    }
}

impl<F: Real> Neg for Dual<F> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            v: -self.v,
            d: -self.d,
        }
    }
}

impl<F: Real> Real for Dual<F> {
    #[inline]
    fn constant(x: f32) -> Self {
        Self {
            v: F::constant(x),
            d: F::constant(0.0),
        }
    }
    #[inline]
    fn value(self) -> f64 {
        self.v.value()
    }
    #[inline]
    fn exp(self) -> Self {
        let v = self.v.exp();
        Self { v, d: self.d * v }
    }
    #[inline]
    fn sqrt(self) -> Self {
        let v = self.v.sqrt();
        Self {
            v,
            d: F::constant(0.5) * self.d / v,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_inverse_is_that_of_libms_erf() {
        for i in 1..400 {
            let x = -0.999 + 0.005 * i as f32;
            // The other number uses the coefficients of the centre, then those of the tail.
            for y in [0.2, 0.998] {
                let [inverse, _] = erf_inverse([x, y]);
                let error = f64::from(x) - libm::erf(inverse.into());
                assert!(error.abs() < 1e-6, "{x} {y}: {error}");
                assert_eq!(erf_inverse([y, x])[1], inverse);
            }
        }
    }

    #[test]
    fn scaled_erfc_is_that_of_libm() {
        for i in 0..4000 {
            let x = 0.005 * i as f32;
            let gauss = (-f64::from(x) * f64::from(x)).exp();
            let error = f64::from(scaled_erfc(x)) * gauss - libm::erfc(x.into());
            assert!(error.abs() < 3e-7, "{x}: {error}");
        }
    }
}
