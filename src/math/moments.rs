//! Running mean and variance of RGB samples, in double precision.
//!
//! Welford's update adds a sample, Chan's merges two sets. Sums of squares would lose every digit of the variance at
//! a mean of 10³ and a deviation of 0.1, and `f32` sums stop growing at 2²⁴ samples; the sum of squared deviations kept
//! here is never negative.

use glam::DVec3;

/// Count, mean and sum of squared deviations of the samples added so far.
///
/// ```
/// use opsr::math::{DVec3, moments::Moments};
/// let mut m = Moments::default();
/// for x in [1.0, 2.0, 3.0] {
///     m.push(DVec3::splat(x));
/// }
/// assert_eq!((m.n, m.mean.x, m.sample_variance().x), (3, 2.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of samples.
    pub n: u32,
    /// Mean of the samples; zero without samples.
    pub mean: DVec3,
    m2: DVec3,
}

impl Moments {
    /// Moments with this count, mean and sum of squared deviations from the mean.
    pub(crate) fn from_parts(n: u32, mean: DVec3, m2: DVec3) -> Self {
        Self { n, mean, m2 }
    }

    /// Adds one sample.
    #[inline]
    pub fn push(&mut self, x: DVec3) {
        self.n += 1;
        let delta = x - self.mean;
        self.mean += delta / f64::from(self.n);
        // Deviations from the old and the new mean have the same sign, so m2 cannot shrink.
        self.m2 += delta * (x - self.mean);
    }

    /// Adds all samples of `other`.
    pub fn merge(&mut self, other: &Self) {
        if other.n == 0 {
            return;
        }
        if self.n == 0 {
            *self = *other;
            return;
        }
        let (a, b) = (f64::from(self.n), f64::from(other.n));
        let delta = other.mean - self.mean;
        self.n += other.n;
        self.mean += delta * (b / (a + b));
        self.m2 += other.m2 + delta * delta * (a * b / (a + b));
    }

    /// Sum of squared deviations from the mean.
    pub fn m2(&self) -> DVec3 {
        self.m2
    }

    /// Unbiased estimate Σ (x − mean)² / (n − 1) of the variance of one sample; zero for fewer than two samples.
    pub fn sample_variance(&self) -> DVec3 {
        if self.n < 2 {
            return DVec3::ZERO;
        }
        self.m2 / f64::from(self.n - 1)
    }

    /// Estimate of the variance of `mean`: the sample variance divided by n; zero for fewer than two samples.
    pub fn variance_of_mean(&self) -> DVec3 {
        if self.n < 2 {
            return DVec3::ZERO;
        }
        self.sample_variance() / f64::from(self.n)
    }
}

#[cfg(test)]
mod tests;
