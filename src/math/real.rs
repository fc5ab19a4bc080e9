//! Numbers that a lobe can be evaluated in: `f32` to render, [`Dual`] to differentiate, `f64` to check.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real number with the few functions that microfacet lobes need.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A constant.
    fn constant(x: f32) -> Self;
    /// The value, without a derivative.
    fn value(self) -> f64;
    /// eˣ.
    fn exp(self) -> Self;
    /// √x, x ≥ 0.
    fn sqrt(self) -> Self;
    /// Smith's Λ of the Beckmann distribution as a function of a = 1/(α tan θ) > 0:
    /// (erf a − 1)/2 + e^(−a²)/(2 a √π) `[Heitz14 (A.9)]`, 0 where it is below 1e-9.
    fn beckmann_lambda(self) -> Self;
}

/// Beyond this a, Λ is below 1e-9 and nothing in single precision sees it.
const LAMBDA_END: f64 = 4.2;

const SQRT_PI: f64 = 1.772_453_850_905_516;

/// (1 − erf x) e^(x²) for x ≥ 0 by Abramowitz and Stegun 7.1.26; error of erf at most 1.5e-7.
#[inline]
pub(crate) fn scaled_erfc(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    t * (0.254_829_6
        + t * (-0.284_496_72 + t * (1.421_413_8 + t * (-1.453_152_1 + t * 1.061_405_4))))
}

/// erf x in single precision, error at most 2e-7.
#[inline]
pub fn erf(x: f32) -> f32 {
    let a = x.abs();
    (1.0 - scaled_erfc(a) * (-a * a).exp()).copysign(x)
}

/// erf x in double precision: the series with positive terms, then the continued fraction.
pub fn erf_f64(x: f64) -> f64 {
    let a = x.abs();
    let gauss = (-a * a).exp();
    let value = if a < 3.0 {
        // 2/√π e^(−x²) Σ 2ⁿ x^(2n+1) / (2n+1)!!
        let (mut term, mut sum, mut n) = (a, a, 0.0);
        while term > 1e-18 * sum {
            n += 1.0;
            term *= 2.0 * a * a / (2.0 * n + 1.0);
            sum += term;
        }
        2.0 / SQRT_PI * gauss * sum
    } else {
        // erfc x = e^(−x²)/√π · 1/(x + ½/(x + 1/(x + 3/2/(x + …))))
        let tail = (1..60).rev().fold(a, |f, k| a + 0.5 * f64::from(k) / f);
        1.0 - gauss / (SQRT_PI * tail)
    };
    value.copysign(x)
}

/// The inverse of erf on (−1, 1), in single precision, after Giles: *Approximating the erfinv function*, 2010.
#[inline]
pub fn erf_inverse(x: f32) -> f32 {
    let w = -((1.0 - x) * (1.0 + x)).ln();
    let horner = |w: f32, c: [f32; 9]| c.into_iter().reduce(|p, c| p * w + c).unwrap_or_default();
    let p = if w < 5.0 {
        let c = [
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
        horner(w - 2.5, c)
    } else {
        let c = [
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
        horner(w.sqrt() - 3.0, c)
    };
    p * x
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
    #[inline]
    fn beckmann_lambda(self) -> Self {
        if self > LAMBDA_END as f32 {
            return 0.0;
        }
        // One exponential serves both terms.
        0.5 * (-self * self).exp() * (1.0 / (self * SQRT_PI as f32) - scaled_erfc(self))
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
    fn beckmann_lambda(self) -> Self {
        if self > LAMBDA_END {
            return 0.0;
        }
        0.5 * (erf_f64(self) - 1.0) + (-self * self).exp() / (2.0 * self * SQRT_PI)
    }
}

/// A value with its derivative: forward differentiation in one variable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<F = f64> {
    /// The value.
    pub v: F,
    /// Its derivative.
    pub d: F,
}

impl<F: Real> Dual<F> {
    /// The variable itself: derivative 1.
    #[inline]
    pub fn variable(v: F) -> Self {
        Self {
            v,
            d: F::constant(1.0),
        }
    }
}

impl Dual<f32> {
    /// The same in double precision.
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
    #[inline]
    fn beckmann_lambda(self) -> Self {
        let a = self.v;
        if a.value() > LAMBDA_END {
            return Self::constant(0.0);
        }
        // The fast value is right to 1e-7 and the derivative exact: dΛ/da = −e^(−a²) / (2 a² √π).
        let gauss = (-a * a).exp();
        // √π to the digits of either precision.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_agrees_with_known_values_and_its_inverse() {
        // DLMF table 7.23: erf(0.5), erf(1), erf(2), erf(3.5).
        for (x, y) in [
            (0.5, 0.520_499_877_813_046_5),
            (1.0, 0.842_700_792_949_714_9),
            (2.0, 0.995_322_265_018_952_7),
            (3.5, 0.999_999_256_901_627_7),
        ] {
            assert!((erf_f64(x) - y).abs() < 1e-15, "{x}");
            assert!((f64::from(erf(x as f32)) - y).abs() < 3e-7, "{x}");
            assert_eq!(erf_f64(-x), -erf_f64(x));
        }
        for i in 1..400 {
            let x = -0.999 + 0.005 * i as f32;
            assert!(
                (f64::from(x) - erf_f64(erf_inverse(x).into())).abs() < 1e-6,
                "{x}"
            );
        }
    }

    #[test]
    fn lambda_of_all_three_numbers_agrees() {
        for i in 1..500 {
            let a = 0.01 * f64::from(i);
            let exact = a.beckmann_lambda();
            let dual = Dual::variable(a).beckmann_lambda();
            assert!(
                (f64::from((a as f32).beckmann_lambda()) - exact).abs() < 2e-7 * (1.0 + exact),
                "{a}"
            );
            assert!((dual.v - exact).abs() < 2e-7, "{a}");
            if a < 4.1 {
                let h = 1e-6;
                let numeric = ((a + h).beckmann_lambda() - (a - h).beckmann_lambda()) / (2.0 * h);
                assert!(
                    (dual.d - numeric).abs() < 1e-6 * numeric.abs().max(1e-3),
                    "{a}: {} {numeric}",
                    dual.d
                );
            }
        }
    }
}
