//! Bias and variance apart, from several independent renders of one picture.

use glam::DVec3;

use super::{Metric, MetricError, check};
use opsr::image::Buffer;
use opsr::image::relative::EPSILON;

/// The mean squared error of one render as bias² and variance, absolute and relative to the reference.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BiasVariance {
    /// Number of renders.
    pub renders: usize,
    /// Error that no average of renders removes. Noise of the estimate can make it slightly negative.
    pub bias_squared: Metric,
    /// Error that averaging removes.
    pub variance: Metric,
    /// `bias_squared` with each pixel over f² + ε.
    pub relative_bias_squared: Metric,
    /// `variance` with each pixel over f² + ε.
    pub relative_variance: Metric,
}

impl BiasVariance {
    /// Bias² and variance, absolute and relative.
    pub fn metrics(&self) -> [&Metric; 4] {
        [
            &self.bias_squared,
            &self.variance,
            &self.relative_bias_squared,
            &self.relative_variance,
        ]
    }
}

/// Splits the error of `renders` against `reference`, which is taken as exact.
///
/// With M the mean and s² the sample variance of K renders, E (M − f)² = bias² + s²/K; the second term is
/// subtracted, so bias² is unbiased: zero on average for an unbiased renderer.
pub fn bias_variance(renders: &[&Buffer], reference: &Buffer) -> Result<BiasVariance, MetricError> {
    if renders.len() < 2 {
        return Err(MetricError::TooFew(renders.len()));
    }
    for render in renders {
        check(render, reference)?;
    }
    let k = renders.len() as f64;
    let mut sums = [0.0; 4];
    for (p, f) in reference.pixels.iter().enumerate() {
        let f = f.as_dvec3();
        let mean = renders
            .iter()
            .map(|r| r.pixels[p].as_dvec3())
            .sum::<DVec3>()
            / k;
        let deviation = |r: &&Buffer| {
            let d = r.pixels[p].as_dvec3() - mean;
            d * d
        };
        let variance = renders.iter().map(deviation).sum::<DVec3>() / (k - 1.0);
        let bias = (mean - f) * (mean - f) - variance / k;
        let scale = f * f + EPSILON;
        let terms = [bias, variance, bias / scale, variance / scale];
        for (sum, term) in sums.iter_mut().zip(terms) {
            *sum += term.element_sum();
        }
    }
    let [bias, variance, rel_bias, rel_variance] =
        sums.map(|s| s / (3.0 * reference.pixels.len() as f64));
    let eps = [("ε", EPSILON)];
    Ok(BiasVariance {
        renders: renders.len(),
        bias_squared: Metric::new("bias²", "mean (M − f)² − s²/K", &[("K", k)], bias),
        variance: Metric::new("variance", "mean s²", &[("K", k)], variance),
        relative_bias_squared: Metric::new(
            "rel. bias²",
            "mean ((M − f)² − s²/K) / (f² + ε)",
            &eps,
            rel_bias,
        ),
        relative_variance: Metric::new("rel. variance", "mean s² / (f² + ε)", &eps, rel_variance),
    })
}
