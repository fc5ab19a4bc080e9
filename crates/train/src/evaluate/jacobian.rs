//! Linear model of a crop's moments: sums over the table's factors, and their sparse Jacobian.

use crate::evaluate::{Adjoint, Moments};
use opsr::math::Vec4;
use std::ops::Range;

/// Mean per channel and second moment of a pixel.
pub(crate) type PixelMoments = [f32; 4];

/// Sums of the moments of each pixel, whose terms are replaced one by one.
///
/// Terms are rounded to a grid on which additions of `f64` are exact, so that a sum depends on its terms alone and not
/// on their order or history: a resumed training has bit-identical sums.
#[derive(Default)]
pub(crate) struct ExactSums {
    /// 1.5 times a power of two above all sums: adding and subtracting it rounds a term to the last place of a sum.
    rounder: [f64; 4],
    pixels: Vec<[f64; 4]>,
}

impl ExactSums {
    /// Zero sums, for terms whose absolute values in a pixel add up to at most `bound`.
    pub(crate) fn new(pixels: usize, bound: [f64; 4]) -> Self {
        Self {
            rounder: bound.map(|b| 1.5 * b.max(f64::MIN_POSITIVE).log2().ceil().exp2() * 2.0),
            pixels: vec![[0.0; 4]; pixels],
        }
    }

    /// Replaces a term.
    #[inline]
    pub(crate) fn exchange(&mut self, pixel: u32, old: PixelMoments, new: PixelMoments) {
        let sum = &mut self.pixels[pixel as usize];
        for c in 0..4 {
            let round = |v: f32| (f64::from(v) + self.rounder[c]) - self.rounder[c];
            sum[c] += round(new[c]) - round(old[c]);
        }
    }

    /// The sums, pixel by pixel.
    pub(crate) fn pixels(&self) -> Vec<PixelMoments> {
        let pixels = self.pixels.iter();
        pixels.map(|sum| sum.map(|s| s as f32)).collect()
    }
}

/// Sparse Jacobian: derivatives of pixels' moments by factors. Elements are ordered by factor; the caller stores the
/// range of each factor.
///
/// A training step reads all elements twice and is bound by memory, so they are stored as bfloat16, with eight bits of
/// mantissa. Moments and gradient use the same rounded numbers, so that the gradient is the derivative of the moments.
#[derive(Default)]
pub(crate) struct Jacobian {
    pixels: Vec<u32>,
    values: Vec<[u16; 4]>,
}

#[inline]
fn pack(derivative: PixelMoments) -> [u16; 4] {
    derivative.map(|d| half::bf16::from_f32(d).to_bits())
}

#[inline]
fn unpack(packed: [u16; 4]) -> PixelMoments {
    // bfloat16 is the upper half of a single; this form compiles to one interleaving with zeros.
    let [a, b, c, d] = packed;
    if cfg!(target_endian = "little") {
        bytemuck::cast([0, a, 0, b, 0, c, 0, d])
    } else {
        bytemuck::cast([a, 0, b, 0, c, 0, d, 0])
    }
}

/// Terms that are summed in single precision before they go into a double.
const BLOCK: usize = 256;

/// Independent partial sums, so that no addition waits for another.
const LANES: usize = 4;

/// Derivatives unpacked at a time, before the reduction: inside it LLVM emits about twenty scalar instructions instead
/// of one interleave.
const UNPACKED: usize = 4 * LANES;

/// Calls `visit` for every derivative in order, with its index in the block, its pixel and its value.
#[inline]
fn each(pixels: &[u32], values: &[[u16; 4]], mut visit: impl FnMut(usize, u32, PixelMoments)) {
    let (pixels, last) = pixels.as_chunks::<UNPACKED>();
    let (values, last_values) = values.as_chunks::<UNPACKED>();
    for (pixels, values) in pixels.iter().zip(values) {
        let mut unpacked = [PixelMoments::default(); UNPACKED];
        let singles = unpacked.as_flattened_mut().iter_mut();
        for (single, &bits) in singles.zip(values.as_flattened()) {
            *single = f32::from_bits(u32::from(bits) << 16);
        }
        for i in 0..UNPACKED {
            visit(i, pixels[i], unpacked[i]);
        }
    }
    for (i, (&pixel, &value)) in last.iter().zip(last_values).enumerate() {
        visit(i, pixel, unpack(value));
    }
}

impl Jacobian {
    /// Number of elements.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Pixels of a range of elements.
    pub(crate) fn pixels(&self, range: Range<usize>) -> &[u32] {
        &self.pixels[range]
    }

    /// `count` zero elements.
    pub(crate) fn zero(count: usize) -> Self {
        Self {
            pixels: vec![0; count],
            values: vec![[0; 4]; count],
        }
    }

    /// No elements, with memory for `count`.
    pub(crate) fn with_capacity(count: usize) -> Self {
        Self {
            pixels: Vec::with_capacity(count),
            values: Vec::with_capacity(count),
        }
    }

    /// Appends a zero element for a pixel.
    pub(crate) fn push(&mut self, pixel: u32) {
        self.pixels.push(pixel);
        self.values.push([0; 4]);
    }

    /// Sets pixel and derivative of an element.
    #[inline]
    pub(crate) fn set(&mut self, index: usize, pixel: u32, derivative: PixelMoments) {
        self.pixels[index] = pixel;
        self.values[index] = pack(derivative);
    }

    /// Sets the derivatives in `range`, each from its index in the range and its pixel.
    pub(crate) fn update(
        &mut self,
        range: Range<usize>,
        mut derivative: impl FnMut(usize, u32) -> PixelMoments,
    ) {
        let values = self.values[range.clone()].iter_mut();
        for (i, (value, &pixel)) in values.zip(&self.pixels[range]).enumerate() {
            *value = pack(derivative(i, pixel));
        }
    }

    /// Adds the change of the moments when the factor of `range` changes by `by`.
    pub(crate) fn follow(&self, range: Range<usize>, by: f32, moments: &mut [PixelMoments]) {
        // Late in a training two of five factors stay at a bound.
        if by == 0.0 {
            return;
        }
        let pixels = &self.pixels[range.clone()];
        each(pixels, &self.values[range], |_, pixel, derivative| {
            let sum = &mut moments[pixel as usize];
            *sum = (Vec4::from_array(*sum) + Vec4::from_array(derivative) * by).to_array();
        });
    }

    /// Derivative of the loss by the factor of `range`, given the loss's derivative by the moments.
    pub(crate) fn gradient(&self, range: Range<usize>, adjoint: &[PixelMoments]) -> f64 {
        let pixels = self.pixels[range.clone()].chunks(BLOCK);
        let values = self.values[range].chunks(BLOCK);
        let block = |(pixels, values): (&[u32], &[[u16; 4]])| {
            let mut sums = [Vec4::ZERO; LANES];
            each(pixels, values, |i, pixel, derivative| {
                let adjoint = Vec4::from_array(adjoint[pixel as usize]);
                sums[i % LANES] += adjoint * Vec4::from_array(derivative);
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

/// Adds the moments of each pixel to means and second moments.
pub(crate) fn add(pixels: &[PixelMoments], moments: &mut Moments) {
    let sums = moments.mean.iter_mut().zip(&mut moments.second);
    for ((mean, second), pixel) in sums.zip(pixels) {
        for (m, p) in mean.iter_mut().zip(pixel) {
            *m += p;
        }
        *second += pixel[3];
    }
}

/// Four derivatives of each pixel, from those of the means and second moments.
pub(crate) fn by_pixel(adjoint: &Adjoint) -> Vec<PixelMoments> {
    adjoint
        .mean
        .iter()
        .zip(&adjoint.second)
        .map(|(m, &second)| [m[0], m[1], m[2], second])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn determinism_of_sums_whatever_their_history() {
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
    fn gradient_is_the_derivative_of_the_followed_moments() {
        let mut rng = rand_pcg::Pcg32::seed_from_u64(8);
        let mut random = || -> PixelMoments { std::array::from_fn(|_| rng.random::<f32>() - 0.5) };
        let mut jacobian = Jacobian::zero(3 * BLOCK);
        for i in 0..jacobian.len() {
            jacobian.set(i, (i * 7 % 50) as u32, random());
        }
        // The second of two factors.
        let range = 40..jacobian.len();
        let adjoint: Vec<PixelMoments> = (0..50).map(|_| random()).collect();
        let mut moments = vec![PixelMoments::default(); 50];
        jacobian.follow(range.clone(), 0.25, &mut moments);
        let pairs = moments.iter().flatten().zip(adjoint.iter().flatten());
        let moved: f64 = pairs.map(|(m, a)| f64::from(*m) * f64::from(*a)).sum();
        let derived = 0.25 * jacobian.gradient(range, &adjoint);
        assert!(moved.abs() > 0.1, "{moved}");
        assert!((moved - derived).abs() < 1e-5, "{moved} {derived}");
    }
}
