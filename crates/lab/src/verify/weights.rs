//! MIS weights of extreme densities, and running moments.

use super::{Finding, Numbers};
use opsr::math::DVec3;
use opsr::math::measure::balance;
use opsr::math::moments::Moments;

pub(super) fn balances() -> Vec<Finding> {
    vec![sums(&balance)]
}

/// Balance heuristic of two densities from 1e-45 to 3e38, of zero and of infinity: weights in [0, 1] with sum 1.
pub fn sums(weight: &dyn Fn(f32, f32) -> f32) -> Finding {
    let mut numbers = Numbers::new(10);
    let mut density = || match numbers.below(12) {
        0 => f32::MAX,
        1 => f32::from_bits(1),
        2 => f32::MIN_POSITIVE,
        _ => numbers.logarithmic(1e-38, 1e38) as f32,
    };
    let mut errors = Vec::new();
    for _ in 0..200_000 {
        let (p, q) = (density(), density());
        let (a, b) = (weight(p, q), weight(q, p));
        let outside = [a, b].map(|w| {
            if (0.0..=1.0).contains(&w) {
                0.0
            } else {
                f64::NAN
            }
        });
        errors.extend(outside);
        errors.push((f64::from(a) + f64::from(b) - 1.0).abs());
    }
    for p in [1e-38, 1.0, 1e38] {
        errors.push(f64::from(weight(0.0, p)));
        errors.push(f64::from(weight(p, 0.0) - 1.0).abs());
        // The density of a light seen exactly edge on.
        errors.push(f64::from(weight(p, f32::INFINITY)));
    }
    Finding::new(
        "two weights for densities 1e-45 to 3e38: sum − 1",
        1e-6,
        errors,
    )
}

/// Mean and variance of a list of samples.
pub type Variance<'a> = &'a dyn Fn(&[f64]) -> (f64, f64);

/// Mean and variance by this program's running moments.
pub fn running(samples: &[f64]) -> (f64, f64) {
    let mut moments = Moments::default();
    samples.iter().for_each(|&x| moments.push(DVec3::splat(x)));
    (moments.mean.x, moments.sample_variance().x)
}

pub(super) fn moments() -> Vec<Finding> {
    vec![spread(&running), many()]
}

/// Relative error of the variance of samples with deviations of 0.1 to 1e-3 about means of 1 to 1e6.
pub fn spread(variance: Variance<'_>) -> Finding {
    let mut numbers = Numbers::new(11);
    let mut errors = Vec::new();
    for mean in [1.0, 1e3, 1e6] {
        for deviation in [0.1, 1e-3] {
            let samples: Vec<f64> = (0..20_000)
                .map(|_| mean + deviation * (f64::from(numbers.next()) - 0.5))
                .collect();
            let n = samples.len() as f64;
            let exact = samples.iter().map(|x| x - mean).sum::<f64>() / n;
            let squares = samples.iter().map(|x| (x - mean - exact).powi(2));
            let expected = squares.sum::<f64>() / (n - 1.0);
            let (found, spread) = variance(&samples);
            errors.push((found - mean - exact).abs() / mean);
            errors.push((spread - expected).abs() / expected);
        }
    }
    Finding::new(
        "relative error of a variance at means up to 1e6",
        1e-6,
        errors,
    )
}

/// Mean and variance of 2²⁶ samples, more than single precision can count, merged from parts.
fn many() -> Finding {
    let mut part = Moments::default();
    for i in 0..1024 {
        part.push(DVec3::splat(1.0 + f64::from(i % 2)));
    }
    let variance = part.m2().x / 1024.0;
    let mut moments = part;
    for _ in 0..16 {
        let other = moments;
        moments.merge(&other);
    }
    let n = f64::from(moments.n);
    Finding::new(
        "mean and variance of 2²⁶ samples: relative error",
        1e-12,
        [
            (n - f64::from(1 << 26)).abs(),
            (moments.mean.x - 1.5).abs(),
            (moments.m2().x / n / variance - 1.0).abs(),
        ],
    )
}
