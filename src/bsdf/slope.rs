//! Slopes of the Beckmann normals that are visible from a direction, along its plane of incidence.
//!
//! At unit roughness and tangent tan θ of the direction, such a slope x ≤ cot θ has a density proportional to
//! (1 − x tan θ) e^(−x²) `[HeitzDEon14 §4.1]`. Its integral F(x) = (1 + erf x)/2 + tan θ e^(−x²)/(2√π) has no closed
//! inverse. In s = tan θ/(1 + tan θ) and the quantile w of a Gaussian, erf w = 2u − 1, the solution of F(x) = u F(cot θ)
//! is w plus a smooth function of both, 0 at normal incidence: a bicubic spline with an error below 1e-6 in u.

use crate::math::Vec4;
use crate::math::real::{SQRT_PI, erf_inverse};
use libm::{erfc, exp};
use std::sync::LazyLock;

/// Nodes in s, from 0 to 1.
const ROWS: usize = 32;

/// Nodes in w, from −[`WIDEST`] to [`WIDEST`].
const COLUMNS: usize = 48;

/// Largest |w| of a uniform number in single precision.
const WIDEST: f64 = 3.85;

/// Extra nodes beyond each end while the spline is fitted, so that its fixed end values do not affect the nodes kept.
const MARGIN: usize = 8;

/// Coefficients of uniform cubic B-splines: of the nodes, and of one more at each end.
type Coefficients = [[f32; COLUMNS + 2]; ROWS + 2];

static SPLINE: LazyLock<Box<Coefficients>> = LazyLock::new(fitted);

/// Clamps a uniform number to the open interval (0, 1): quantiles of the Gaussian are infinite at its ends.
#[inline]
fn open(u: f32) -> f32 {
    u.clamp(3e-8, 1.0 - 6e-8)
}

/// Quantiles w, erf w = 2u − 1, of two uniform numbers u.
#[inline]
fn quantiles([u, v]: [f32; 2]) -> [f32; 2] {
    erf_inverse([2.0 * open(u) - 1.0, 2.0 * open(v) - 1.0])
}

/// Gaussian quantiles of the two uniform numbers of a draw, which do not depend on direction or roughness.
#[derive(Clone, Copy, Debug)]
pub struct Quantiles {
    /// Weights of the four coefficients of the spline from `column` on.
    along: Vec4,
    column: u32,
    /// Quantile of the first number: the slope along the plane of incidence at normal incidence.
    w: f32,
    /// Quantile of the second: the slope across it, at unit roughness.
    pub(super) across: f32,
}

impl Quantiles {
    /// Quantiles of numbers in [0, 1].
    #[inline]
    pub(super) fn of(u: [f32; 2]) -> Self {
        let [w, across] = quantiles(u);
        let place = (w + WIDEST as f32) * ((COLUMNS - 1) as f32 / (2.0 * WIDEST as f32));
        let column = (place as u32).min(COLUMNS as u32 - 2);
        Self {
            along: weights(place - column as f32),
            column,
            w,
            across,
        }
    }
}

/// Samples the slope for tan θ = `tan` ≥ 0.
#[inline]
pub(super) fn visible_slope(tan: f32, quantiles: &Quantiles) -> f32 {
    let s = 1.0 - 1.0 / (1.0 + tan);
    let row = s * (ROWS - 1) as f32;
    let i = (row as usize).min(ROWS - 2);
    let j = quantiles.column as usize;
    let across = weights(row - i as f32).to_array();
    let spline = &**SPLINE;
    let mut sum = Vec4::ZERO;
    for (k, weight) in across.into_iter().enumerate() {
        sum += weight * Vec4::from_slice(&spline[i + k][j..j + 4]);
    }
    (quantiles.w + sum.dot(quantiles.along)).min(1.0 / tan)
}

/// Values of the four cubic B-splines at this fraction of a cell.
#[inline]
fn weights(f: f32) -> Vec4 {
    let g = 1.0 - f;
    let (f2, g2) = (f * f, g * g);
    Vec4::new(
        g2 * g,
        4.0 - 3.0 * f2 * (1.0 + g),
        4.0 - 3.0 * g2 * (1.0 + f),
        f2 * f,
    ) * (1.0 / 6.0)
}

fn fitted() -> Box<Coefficients> {
    const HEIGHT: usize = ROWS + 2 * MARGIN;
    const WIDTH: usize = COLUMNS + 2 * MARGIN;
    let place = |i: usize, nodes: usize| (i as f64 - MARGIN as f64) / (nodes - 1) as f64;
    let row = |i| {
        let s = place(i, ROWS);
        let mut x = f64::NEG_INFINITY;
        let mut row: Vec<f64> = (0..WIDTH)
            .map(|j| {
                let w = WIDEST * (2.0 * place(j, COLUMNS) - 1.0);
                x = solution(s, w, x);
                x - w
            })
            .collect();
        fit(&mut row);
        row
    };
    let rows: Vec<Vec<f64>> = (0..HEIGHT).map(row).collect();
    let mut coefficients = Box::new([[0.0; COLUMNS + 2]; ROWS + 2]);
    for j in 0..COLUMNS + 2 {
        let mut column: Vec<f64> = rows.iter().map(|row| row[j + MARGIN - 1]).collect();
        fit(&mut column);
        for (i, row) in coefficients.iter_mut().enumerate() {
            row[j] = column[i + MARGIN - 1] as f32;
        }
    }
    coefficients
}

/// Replaces values at nodes by the coefficients of a spline: (c₋ + 4 c + c₊)/6 is the value. The end values stay.
fn fit(values: &mut [f64]) {
    let wanted = values.to_vec();
    for _ in 0..40 {
        for i in 1..values.len() - 1 {
            values[i] = 1.5 * wanted[i] - 0.25 * (values[i - 1] + values[i + 1]);
        }
    }
}

/// Solves (1 − s) F(x) = u (1 − s) F(cot θ) for x, with erf w = 2u − 1. It is valid below the horizon too, s > 1. For
/// s < 0 there is no direction, and F(cot θ) is 1, as it is to all digits for s little above 0. Newton's method inside
/// a bracket, from `below`, the solution for a smaller w.
fn solution(s: f64, w: f64, below: f64) -> f64 {
    let scaled = |x: f64| 0.5 * ((1.0 - s) * erfc(-x) + s * exp(-x * x) / SQRT_PI);
    let horizon = (1.0 - s) / s;
    let (mut low, mut high) = (below.max(-8.0), 8.0f64);
    if s > 0.0 {
        high = high.min(horizon);
    } else if s < 0.0 {
        low = low.max(horizon);
    }
    let whole = if s > 0.0 { scaled(horizon) } else { 1.0 - s };
    let target = whole * 0.5 * erfc(-w);
    let mut x = if below > -8.0 {
        below
    } else {
        w.clamp(low, high)
    };
    for _ in 0..60 {
        let error = scaled(x) - target;
        if error > 0.0 {
            high = x
        } else {
            low = x
        }
        let next = x - error * SQRT_PI / (exp(-x * x) * (1.0 - s - s * x));
        let next = if next > low && next < high {
            next
        } else {
            0.5 * (low + high)
        };
        let moved = (next - x).abs();
        x = next;
        if moved < 1e-10 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::erf;

    /// F in double precision.
    fn integral(x: f64, tan: f64) -> f64 {
        0.5 * (1.0 + erf(x)) + 0.5 * tan * exp(-x * x) / SQRT_PI
    }

    #[test]
    fn visible_slope_inverts_its_cdf() {
        let mut worst = 0.0f64;
        for exponent in -400..=600 {
            let tan = 10f32.powf(exponent as f32 * 0.01);
            let whole = integral(1.0 / f64::from(tan), tan.into());
            for i in 0..=2000 {
                // Evenly spaced, and denser towards both ends.
                let t = i as f32 / 2000.0;
                for u in [t, 1e-4 * t, 1.0 - 1e-4 * t] {
                    let x = visible_slope(tan, &Quantiles::of([u, 0.5]));
                    assert!(x <= 1.0 / tan, "{tan} {u}: {x} is not visible");
                    let error = integral(x.into(), tan.into()) / whole - f64::from(open(u));
                    worst = worst.max(error.abs());
                }
            }
        }
        println!("{worst:e}");
        // Errors: 6e-7 of the spline, 1.5e-7 of the quantile and 6e-8 of u.
        assert!(worst < 1e-6, "{worst:e}");
    }

    #[test]
    fn visible_slope_at_normal_and_at_grazing_incidence() {
        for u in [0.001, 0.01, 0.3, 0.5, 0.9, 0.999] {
            let [normal, _] = erf_inverse([2.0 * u - 1.0, 0.0]);
            let quantiles = Quantiles::of([u, 0.5]);
            assert!((visible_slope(0.0, &quantiles) - normal).abs() < 1e-6);
            let grazing = -(-u.ln()).sqrt();
            let far = (visible_slope(f32::INFINITY, &quantiles) - grazing).abs();
            assert!(far < 1e-4, "{u}: {far}");
        }
    }
}
