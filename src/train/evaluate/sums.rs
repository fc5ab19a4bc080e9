//! ExactSums over the factors of a table, of which a training step changes only some.

use crate::math::Vec4;
use crate::train::evaluate::moments::{Adjoint, Moments};
use std::ops::Range;

/// Mean per channel and second moment of some pixels, as sums of contributions that come and go.
///
/// Contributions are rounded to a grid on which additions of `f64` are exact, so that a sum depends on what it is made
/// of and not on how it came about: a training that goes on from a checkpoint has the same sums to the bit.
#[derive(Default)]
pub(in crate::train) struct ExactSums {
    /// 1.5 times the power of two above all sums: what is added to it is rounded to its last place.
    rounder: [f64; 4],
    pixels: Vec<[f64; 4]>,
}

impl ExactSums {
    /// Zeros, for contributions whose absolute values in a pixel add up to at most `bound`.
    pub(in crate::train) fn new(pixels: usize, bound: [f64; 4]) -> Self {
        Self {
            rounder: bound.map(|b| 1.5 * b.max(f64::MIN_POSITIVE).log2().ceil().exp2() * 2.0),
            pixels: vec![[0.0; 4]; pixels],
        }
    }

    /// Replaces a contribution.
    #[inline]
    pub(in crate::train) fn exchange(&mut self, pixel: u32, old: [f32; 4], new: [f32; 4]) {
        let sum = &mut self.pixels[pixel as usize];
        for c in 0..4 {
            let round = |v: f32| (f64::from(v) + self.rounder[c]) - self.rounder[c];
            sum[c] += round(new[c]) - round(old[c]);
        }
    }

    /// The sums, pixel by pixel.
    pub(in crate::train) fn rows(&self) -> Vec<PixelMoments> {
        let rows = self.pixels.iter();
        rows.map(|sum| sum.map(|s| s as f32)).collect()
    }
}

/// Mean per channel and second moment of a pixel side by side.
pub(in crate::train) type PixelMoments = [f32; 4];

/// Derivatives of the rows of pixels by the factor that they depend on.
///
/// A training step reads all of them twice and waits for memory, so they are kept with eight bits of mantissa. Moments
/// and gradients follow the same slopes, so that one stays the derivative of the other.
#[derive(Default)]
pub(in crate::train) struct Jacobian {
    pixels: Vec<u32>,
    values: Vec<[u16; 4]>,
}

#[inline]
fn pack(slope: PixelMoments) -> [u16; 4] {
    slope.map(|s| half::bf16::from_f32(s).to_bits())
}

#[inline]
fn unpack(packed: [u16; 4]) -> PixelMoments {
    // The upper halves of singles, in a form that compiles to one interleaving with zeros.
    let [a, b, c, d] = packed;
    if cfg!(target_endian = "little") {
        bytemuck::cast([0, a, 0, b, 0, c, 0, d])
    } else {
        bytemuck::cast([a, 0, b, 0, c, 0, d, 0])
    }
}

/// Terms that are added up in single precision.
const BLOCK: usize = 256;

/// ExactSums that are made side by side, so that none waits for another.
const LANES: usize = 4;

/// Jacobian that are unpacked together: between sums the compiler makes of one interleaving twenty scalar instructions.
const PART: usize = 4 * LANES;

/// Hands every slope over, in their order, with its number (in its part) and its pixel.
#[inline]
fn each(pixels: &[u32], values: &[[u16; 4]], mut hand: impl FnMut(usize, u32, PixelMoments)) {
    let (pixels, last) = pixels.as_chunks::<PART>();
    let (values, last_values) = values.as_chunks::<PART>();
    for (pixels, values) in pixels.iter().zip(values) {
        let mut slopes = [PixelMoments::default(); PART];
        let singles = slopes.as_flattened_mut().iter_mut();
        for (single, &bits) in singles.zip(values.as_flattened()) {
            *single = f32::from_bits(u32::from(bits) << 16);
        }
        for i in 0..PART {
            hand(i, pixels[i], slopes[i]);
        }
    }
    for (i, (&pixel, &value)) in last.iter().zip(last_values).enumerate() {
        hand(i, pixel, unpack(value));
    }
}

impl Jacobian {
    /// Number of slopes.
    pub(in crate::train) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Pixels of some slopes.
    pub(in crate::train) fn pixels(&self, range: Range<usize>) -> &[u32] {
        &self.pixels[range]
    }

    /// Jacobian of no pixel, to be set.
    pub(in crate::train) fn zero(count: usize) -> Self {
        Self {
            pixels: vec![0; count],
            values: vec![[0; 4]; count],
        }
    }

    /// Appends a pixel without a slope.
    pub(in crate::train) fn push(&mut self, pixel: u32) {
        self.pixels.push(pixel);
        self.values.push([0; 4]);
    }

    /// Sets a pixel and its slope.
    #[inline]
    pub(in crate::train) fn set(&mut self, index: usize, pixel: u32, slope: PixelMoments) {
        self.pixels[index] = pixel;
        self.values[index] = pack(slope);
    }

    /// Sets the slopes in `range`; `slope` is told of each one's number there and its pixel.
    pub(in crate::train) fn update(
        &mut self,
        range: Range<usize>,
        mut slope: impl FnMut(usize, u32) -> PixelMoments,
    ) {
        let values = self.values[range.clone()].iter_mut();
        for (i, (value, &pixel)) in values.zip(&self.pixels[range]).enumerate() {
            *value = pack(slope(i, pixel));
        }
    }

    /// Moves the factor that those in `range` belong to by this much.
    pub(in crate::train) fn follow(&self, range: Range<usize>, by: f32, rows: &mut [PixelMoments]) {
        // In the end two factors of five stay at a bound.
        if by == 0.0 {
            return;
        }
        let pixels = &self.pixels[range.clone()];
        each(pixels, &self.values[range], |_, pixel, slope| {
            let row = &mut rows[pixel as usize];
            *row = (Vec4::from_array(*row) + Vec4::from_array(slope) * by).to_array();
        });
    }

    /// The derivative by the factor that those in `range` belong to of what has this derivative by the moments.
    pub(in crate::train) fn gradient(&self, range: Range<usize>, adjoint: &[PixelMoments]) -> f64 {
        let pixels = self.pixels[range.clone()].chunks(BLOCK);
        let values = self.values[range].chunks(BLOCK);
        let block = |(pixels, values): (&[u32], &[[u16; 4]])| {
            let mut sums = [Vec4::ZERO; LANES];
            each(pixels, values, |i, pixel, slope| {
                let row = Vec4::from_array(adjoint[pixel as usize]);
                sums[i % LANES] += row * Vec4::from_array(slope);
            });
            let mut total = [0.0; 4];
            for sum in sums {
                for c in 0..4 {
                    total[c] += f64::from(sum[c]);
                }
            }
            total.iter().sum::<f64>()
        };
        pixels.zip(values).map(block).sum()
    }
}

/// Adds rows to moments.
pub(in crate::train) fn add(rows: &[PixelMoments], moments: &mut Moments) {
    let pixels = moments.mean.iter_mut().zip(&mut moments.second);
    for ((mean, second), row) in pixels.zip(rows) {
        for (m, r) in mean.iter_mut().zip(row) {
            *m += r;
        }
        *second += row[3];
    }
}

/// An adjoint with all that belongs to a pixel side by side.
pub(in crate::train) fn rows(adjoint: &Adjoint) -> Vec<PixelMoments> {
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
        let mut walked = ExactSums::new(1, bound);
        for v in &first {
            walked.exchange(0, [0.0; 4], *v);
        }
        for (old, new) in first.iter().zip(&last).rev() {
            walked.exchange(0, *old, *new);
        }
        let mut direct = ExactSums::new(1, bound);
        for v in &last {
            direct.exchange(0, [0.0; 4], *v);
        }
        assert_eq!(walked.pixels, direct.pixels);
        for c in 0..4 {
            let sum: f64 = last.iter().map(|v| f64::from(v[c])).sum();
            assert!((direct.pixels[0][c] - sum).abs() < 1e-9);
        }
    }

    #[test]
    fn slopes_are_followed_as_they_are_derived() {
        let mut rng = rand_pcg::Pcg32::seed_from_u64(8);
        let mut row = || -> PixelMoments { std::array::from_fn(|_| rng.random::<f32>() - 0.5) };
        let mut slopes = Jacobian::zero(3 * BLOCK);
        for i in 0..slopes.len() {
            slopes.set(i, (i * 7 % 50) as u32, row());
        }
        // The second of two factors.
        let range = 40..slopes.len();
        let adjoint: Vec<PixelMoments> = (0..50).map(|_| row()).collect();
        let mut rows = vec![PixelMoments::default(); 50];
        slopes.follow(range.clone(), 0.25, &mut rows);
        let pairs = rows.iter().flatten().zip(adjoint.iter().flatten());
        let moved: f64 = pairs.map(|(r, a)| f64::from(*r) * f64::from(*a)).sum();
        let derived = 0.25 * slopes.gradient(range, &adjoint);
        assert!(moved.abs() > 0.1, "{moved}");
        assert!((moved - derived).abs() < 1e-5, "{moved} {derived}");
    }
}
