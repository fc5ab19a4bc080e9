//! The error of a picture's mean where its pixels are correlated.
//!
//! The pixels of a bidirectional estimator share light paths, so their noise is correlated: the variance of their sum
//! exceeds the sum of their variances. The samples of the whole picture are independent, however. Sums over all pixels
//! are therefore kept in batches by sample number, and the spread of the batches gives the error of the mean. Sums are
//! exact: they are the same for a render in tiles, parts or joined crops, and for one that was stopped and resumed.

use crate::math::exact::ExactSum;
use crate::math::{DVec3, Rgb};

/// Number of batches. The relative error of the standard error that they give is 1 / √(2 (16 − 1)) = 18 %.
pub(super) const BATCHES: usize = 16;

/// Sums of all pixels of a picture, by batch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batches {
    /// Number of pixel values added.
    counts: [u64; BATCHES],
    /// Their sums by channel.
    sums: [[ExactSum; 3]; BATCHES],
}

/// Noise that is correlated between the pixels of a film.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Sharing {
    /// Pixels are independent.
    #[default]
    None,
    /// Sums of all pixels in batches.
    Batches(Box<Batches>),
    /// Standard error of the mean by channel, as a file states it.
    Stated(DVec3),
    /// Pixels share noise of unknown size.
    Unknown,
}

impl Sharing {
    /// Combines this with the shared noise of independent samples of the same pixels.
    pub(crate) fn merge(&mut self, other: &Self) {
        match (&mut *self, other) {
            (Self::None, Self::None) => {}
            (Self::Batches(all), Self::Batches(more)) => all.merge(more),
            _ => *self = Self::Unknown,
        }
    }
}

impl Batches {
    /// Length of [`Batches::numbers`].
    const NUMBERS: usize = BATCHES * (1 + 3 * ExactSum::WORDS);

    /// Adds a finite value of a pixel.
    #[inline]
    pub(crate) fn add(&mut self, value: Rgb, sample: u32) {
        let batch = sample as usize % BATCHES;
        self.counts[batch] += 1;
        let channels = self.sums[batch].iter_mut().zip(value.to_array());
        channels.for_each(|(sum, x)| sum.add(x));
    }

    /// Adds the sums of another film, of the same samples or of others.
    pub(crate) fn merge(&mut self, other: &Self) {
        for batch in 0..BATCHES {
            self.counts[batch] += other.counts[batch];
            let channels = self.sums[batch].iter_mut().zip(&other.sums[batch]);
            channels.for_each(|(sum, more)| sum.plus(more));
        }
    }

    /// Number of values that were added.
    pub(crate) fn count(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Standard error of the mean of all values by channel; `None` for fewer than two batches.
    ///
    /// With nᵢ values of mean xᵢ in B batches its square is Σ nᵢ (xᵢ − x)² / ((B − 1) Σ nᵢ), unbiased for any nᵢ.
    pub(crate) fn error(&self) -> Option<DVec3> {
        let filled = || (0..BATCHES).filter(|&i| self.counts[i] > 0);
        let count = self.count() as f64;
        let sum = |i: usize| DVec3::from_array(self.sums[i].map(|sum| sum.value()));
        let mean = filled().map(sum).sum::<DVec3>() / count;
        let spread = filled().map(|i| {
            let n = self.counts[i] as f64;
            let apart = sum(i) / n - mean;
            n * apart * apart
        });
        let batches = filled().count();
        let variance = spread.sum::<DVec3>() / (batches.saturating_sub(1) as f64 * count);
        (batches > 1).then(|| variance.powf(0.5))
    }

    /// Counts and sums as numbers, for a file.
    pub(crate) fn numbers(&self) -> Vec<u64> {
        let sums = self.sums.iter().flatten().flat_map(ExactSum::words);
        self.counts.iter().copied().chain(sums).collect()
    }

    /// The sums of these [`Batches::numbers`]; `None` if their count is wrong.
    pub(crate) fn from_numbers(numbers: &[u64]) -> Option<Self> {
        if numbers.len() != Self::NUMBERS {
            return None;
        }
        let (counts, words) = numbers.split_at(BATCHES);
        let (words, _) = words.as_chunks::<{ ExactSum::WORDS }>();
        let mut batches = Self::default();
        batches.counts.copy_from_slice(counts);
        let sums = batches.sums.iter_mut().flatten().zip(words);
        sums.for_each(|(sum, words)| *sum = ExactSum::from_words(*words));
        Some(batches)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three samples of two pixels: means 1, 2 and 6, whose variance is 7.
    #[test]
    fn error_of_few_samples() {
        let mut batches = Batches::default();
        assert_eq!(batches.error(), None);
        for (sample, value) in [1.0, 2.0, 6.0].into_iter().enumerate() {
            for d in [0.5, -0.5] {
                batches.add(Rgb::splat(value + d), sample as u32);
            }
        }
        let error = batches.error().expect("three batches").x;
        assert!((error - (7.0f64 / 3.0).sqrt()).abs() < 1e-12, "{error}");
        let again = Batches::from_numbers(&batches.numbers());
        assert_eq!(again, Some(batches));
        assert_eq!(Batches::from_numbers(&[1; 7]), None);
    }
}
