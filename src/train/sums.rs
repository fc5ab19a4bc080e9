//! Sums over the factors of a table, of which a training step changes only some.

use super::moments::{Adjoint, Moments};
use std::ops::Range;

/// Mean per channel and second moment of some pixels, as sums of contributions that come and go.
///
/// Contributions are rounded to a grid on which additions of `f64` are exact, so that a sum depends on what it is made
/// of and not on how it came about: a training that goes on from a checkpoint has the same sums to the bit.
#[derive(Default)]
pub(super) struct Sums {
    /// 1.5 times the power of two above all sums: what is added to it is rounded to its last place.
    rounder: [f64; 4],
    pixels: Vec<[f64; 4]>,
}

impl Sums {
    /// Zeros, for contributions whose absolute values in a pixel add up to at most `bound`.
    pub(super) fn new(pixels: usize, bound: [f64; 4]) -> Self {
        Self {
            rounder: bound.map(|b| 1.5 * b.max(f64::MIN_POSITIVE).log2().ceil().exp2() * 2.0),
            pixels: vec![[0.0; 4]; pixels],
        }
    }

    /// Replaces a contribution.
    #[inline]
    pub(super) fn exchange(&mut self, pixel: u32, old: [f32; 4], new: [f32; 4]) {
        let sum = &mut self.pixels[pixel as usize];
        for c in 0..4 {
            let round = |v: f32| (f64::from(v) + self.rounder[c]) - self.rounder[c];
            sum[c] += round(new[c]) - round(old[c]);
        }
    }

    /// Adds the sums to moments.
    pub(super) fn add_to(&self, moments: &mut Moments) {
        let pixels = moments.mean.iter_mut().zip(&mut moments.second);
        for ((mean, second), sum) in pixels.zip(&self.pixels) {
            for (m, s) in mean.iter_mut().zip(sum) {
                *m += *s as f32;
            }
            *second += sum[3] as f32;
        }
    }
}

/// Derivatives of (mean, second) of pixels by the factor that they depend on.
#[derive(Default)]
pub(super) struct Slopes {
    pub(super) pixels: Vec<u32>,
    pub(super) values: Vec<[f32; 4]>,
}

impl Slopes {
    /// The derivative by the factor that those in `range` belong to of what has this derivative by the moments.
    pub(super) fn gradient(&self, range: Range<usize>, adjoint: &[[f32; 4]]) -> f64 {
        let mut sum = [0.0f64; 4];
        for (&pixel, slope) in self.pixels[range.clone()].iter().zip(&self.values[range]) {
            let row = adjoint[pixel as usize];
            for c in 0..4 {
                sum[c] += f64::from(row[c] * slope[c]);
            }
        }
        sum.iter().sum()
    }
}

/// An adjoint with all that belongs to a pixel side by side.
pub(super) fn rows(adjoint: &Adjoint) -> Vec<[f32; 4]> {
    (adjoint.mean.iter().zip(&adjoint.second))
        .map(|(m, &second)| [m[0], m[1], m[2], second])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn sums_do_not_remember() {
        let mut rng = rand_pcg::Pcg32::seed_from_u64(5);
        let mut value = || -> [f32; 4] {
            std::array::from_fn(|_| (rng.random::<f32>() * 20.0 - 18.0).exp() - 0.2)
        };
        let (first, last): (Vec<_>, Vec<_>) = (0..500).map(|_| (value(), value())).unzip();
        let bound = [500.0 * 8.0; 4];
        let mut walked = Sums::new(1, bound);
        for v in &first {
            walked.exchange(0, [0.0; 4], *v);
        }
        for (old, new) in first.iter().zip(&last).rev() {
            walked.exchange(0, *old, *new);
        }
        let mut direct = Sums::new(1, bound);
        for v in &last {
            direct.exchange(0, [0.0; 4], *v);
        }
        assert_eq!(walked.pixels, direct.pixels);
        for c in 0..4 {
            let sum: f64 = last.iter().map(|v| f64::from(v[c])).sum();
            assert!((direct.pixels[0][c] - sum).abs() < 1e-9);
        }
    }
}
