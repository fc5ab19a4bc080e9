//! Ratios of methods over seeds: paired, with intervals and a verdict.
//!
//! Every seed is rendered with every method, and methods are compared seed by seed, so that common effects of a seed
//! cancel. A ratio is the geometric mean of the seeds' ratios, which treats a factor 2 and a factor ½ alike.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::student;

/// Confidence of all intervals.
pub(crate) const CONFIDENCE: f64 = 0.95;

/// Least number of seeds for a verdict.
pub(crate) const MIN_SEEDS: usize = 5;

/// Resamples of a bootstrap. With five seeds each end of an interval depends on about ten of them.
const RESAMPLES: usize = 10_000;

/// Seed of all bootstraps: equal data give equal intervals.
const BOOTSTRAP_SEED: u64 = 0x0b5e_55ed;

/// An estimate and its `CONFIDENCE` interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// True if `x` lies in the interval, ends included.
    pub fn holds(&self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }
}

/// Verdict on a ratio of errors or costs, ours over the baseline's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The interval lies below 1.
    Better,
    /// The interval lies above 1.
    Worse,
    /// The interval holds 1.
    Tie,
    /// Fewer than `MIN_SEEDS` seeds.
    TooFewSeeds,
}

impl Verdict {
    /// The verdict on a ratio over `seeds` seeds.
    pub fn of(ratio: &Interval, seeds: usize) -> Self {
        if seeds < MIN_SEEDS {
            Self::TooFewSeeds
        } else if ratio.high < 1.0 {
            Self::Better
        } else if ratio.low > 1.0 {
            Self::Worse
        } else {
            Self::Tie
        }
    }

    /// The verdict in words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::Tie => "tie",
            Self::TooFewSeeds => "too few seeds",
        }
    }
}

/// The geometric mean of `ours[i] / baseline[i]` with its bootstrap interval.
///
/// `None` without pairs, or if a ratio is not a positive number; two zeros have the ratio 1.
pub(crate) fn paired_ratio(ours: &[f64], baseline: &[f64]) -> Option<Interval> {
    if ours.len() != baseline.len() {
        return None;
    }
    let log_ratio = |(&a, &b): (&f64, &f64)| {
        let log = if a == b { 0.0 } else { (a / b).ln() };
        log.is_finite().then_some(log)
    };
    let logs: Option<Vec<f64>> = ours.iter().zip(baseline).map(log_ratio).collect();
    let log = bootstrap_mean(&logs?)?;
    Some(Interval {
        value: log.value.exp(),
        low: log.low.exp(),
        high: log.high.exp(),
    })
}

/// The mean with its bootstrap interval: percentiles of the means of resamples.
///
/// Percentiles of few values are too narrow. Taking them at Φ(−√(n/(n−1)) t) instead of Φ(−z) compensates, exactly for
/// the normal distribution and many resamples. [Hesterberg15 §5]
pub(crate) fn bootstrap_mean(values: &[f64]) -> Option<Interval> {
    let n = values.len();
    let value = mean(values)?;
    if n < 2 || values.iter().all(|v| *v == values[0]) {
        let (low, high) = match n {
            1 => (f64::NEG_INFINITY, f64::INFINITY),
            _ => (value, value),
        };
        return Some(Interval { value, low, high });
    }
    let mut rng = Pcg32::seed_from_u64(BOOTSTRAP_SEED);
    let mut means: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            (0..n)
                .map(|_| values[rng.random_range(0..n as u32) as usize])
                .sum::<f64>()
                / n as f64
        })
        .collect();
    means.sort_unstable_by(f64::total_cmp);
    let degrees = (n - 1) as f64;
    let expanded = (n as f64 / degrees).sqrt() * student::quantile(1.0 - CONFIDENCE, degrees);
    let tail = 0.5 * student::two_sided(expanded, f64::INFINITY);
    let skip = ((tail * RESAMPLES as f64) as usize).min(RESAMPLES / 2 - 1);
    Some(Interval {
        value,
        low: means[skip],
        high: means[RESAMPLES - 1 - skip],
    })
}

/// The mean with Student's interval.
pub(crate) fn mean_interval(values: &[f64]) -> Option<Interval> {
    let value = mean(values)?;
    let n = values.len() as f64;
    if values.len() < 2 {
        let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
        return Some(Interval { value, low, high });
    }
    let square = values
        .iter()
        .map(|v| (v - value) * (v - value))
        .sum::<f64>();
    let deviation = (square / (n - 1.0) / n).sqrt();
    let half = student::quantile(1.0 - CONFIDENCE, n - 1.0) * deviation;
    Some(Interval {
        value,
        low: value - half,
        high: value + half,
    })
}

/// Squared bias from the products of the seeds' errors; `None` with fewer than three seeds.
///
/// `products[k][l]` is the mean over the picture of (Iₖ − f)(Iₗ − f)/(f² + ε). Seeds are independent, so for k ≠ l its
/// expectation is the squared bias plus the reference's own noise, which is subtracted. The mean over all pairs is the
/// unbiased estimate; its interval is the jackknife's over seeds.
pub fn squared_bias(products: &[Vec<f64>], reference_noise: f64) -> Option<Interval> {
    let n = products.len();
    if n < 3 || products.iter().any(|row| row.len() != n) {
        return None;
    }
    let row: Vec<f64> = (0..n)
        .map(|k| (0..n).filter(|&l| l != k).map(|l| products[k][l]).sum())
        .collect();
    let total: f64 = row.iter().sum();
    let pairs = |n: usize| (n * (n - 1)) as f64;
    let value = total / pairs(n);
    // Without a seed, both orders of its pairs are missing.
    let pseudo: Vec<f64> = row
        .iter()
        .map(|r| {
            let without = (total - 2.0 * r) / pairs(n - 1);
            n as f64 * value - (n as f64 - 1.0) * without
        })
        .collect();
    let spread = mean_interval(&pseudo)?;
    Some(Interval {
        value: value - reference_noise,
        low: spread.low - reference_noise,
        high: spread.high - reference_noise,
    })
}

/// The arithmetic mean.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The geometric mean of positive numbers.
pub(crate) fn geometric_mean(values: &[f64]) -> Option<f64> {
    let logs: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    mean(&logs).map(f64::exp).filter(|v| v.is_finite())
}

#[cfg(test)]
mod tests;
