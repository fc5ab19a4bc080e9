//! Gaussian filters that stop at edges of what a path has met.

use super::filter::Size;
use super::layer::Batches;
use crate::image::level_film::{BATCHES, Features};
use crate::math::Vec3A;

/// Standard deviations that a filter reaches.
const REACH: f32 = 2.2;

/// Weight of the squared difference of normals in the exponent.
const NORMAL: f32 = 10.0;

/// Difference of reflectance that counts as one standard deviation.
const ALBEDO: f32 = 0.05;

/// Share of a length that counts as one standard deviation of lengths.
const LENGTH: f32 = 0.02;

/// The surface that stops a filter.
#[derive(Clone, Copy)]
pub(super) enum Surface {
    /// That of the first vertex.
    First,
    /// That of the first rough vertex.
    Rough,
}

/// Pixels that a filter of this standard deviation reaches.
pub(super) fn reach(sigma: f32) -> usize {
    (2.0 * sigma).ceil() as usize
}

/// Edges that stop a filter, as planes.
pub(super) struct Guide {
    size: Size,
    /// Normal and, where it counts, reflectance: their squared differences are those of the exponent.
    planes: Vec<Vec<f32>>,
    /// Variance of the normals in a pixel on an edge, in the exponent.
    spread: Vec<f32>,
    length: Vec<f32>,
    /// Difference of lengths that counts as one standard deviation at a pixel, and what a plane adds to it a pixel away.
    slope: Vec<[f32; 2]>,
}

/// Variance of the normals in pixels on an edge between surfaces, times [`NORMAL`]: of unit normals it is 1 − |mean|². What
/// two pixels on opposite sides have, too, is no edge but gloss, or light that leaves the scene.
fn spread((width, height): Size, features: &[Features], first: usize) -> Vec<f32> {
    let length2 = |x: usize, y: usize| -> f32 {
        let normal = &features[y * width + x][first..first + 3];
        normal.iter().map(|n| n * n).sum()
    };
    let of = |i: usize| {
        let (x, y) = (i % width, i / width);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return 0.0;
        }
        let around = [
            length2(x - 1, y).min(length2(x + 1, y)),
            length2(x, y - 1).min(length2(x, y + 1)),
            length2(x - 1, y - 1).min(length2(x + 1, y + 1)),
            length2(x - 1, y + 1).min(length2(x + 1, y - 1)),
        ];
        let most = around.into_iter().fold(0.0, f32::max);
        NORMAL * (most - length2(x, y)).max(0.0)
    };
    (0..features.len()).map(of).collect()
}

impl Guide {
    /// The normal of a surface and its distance along the path; of the first its reflectance, too.
    pub(super) fn new(size: Size, surface: Surface, features: &[Features]) -> Self {
        let (width, height) = size;
        let (first, scales): (usize, &[f32]) = match surface {
            Surface::Rough => (0, &[]),
            Surface::First => (4, &[0.5f32.sqrt() / ALBEDO; 3]),
        };
        let plane = |at: usize, scale: f32| features.iter().map(|f| f[at] * scale).collect();
        let normals = (first..first + 3).map(|at| plane(at, NORMAL.sqrt()));
        let reflectance = scales.iter().enumerate();
        let planes = normals.chain(reflectance.map(|(c, &scale)| plane(first + 4 + c, scale)));
        let planes = planes.collect();
        let length: Vec<f32> = plane(first + 3, 1.0);
        let slope = |i: usize| {
            let (x, y) = (i % width, i / width);
            let at = |x: usize, y: usize| length[y * width + x];
            let across = (at((x + 1).min(width - 1), y) - at(x.saturating_sub(1), y)).abs();
            let along = (at(x, (y + 1).min(height - 1)) - at(x, y.saturating_sub(1))).abs();
            let here = LENGTH * length[i] + f32::MIN_POSITIVE.sqrt();
            [here, 0.25 * across.max(along)]
        };
        let slope = (0..length.len()).map(slope).collect();
        Self {
            size,
            planes,
            spread: spread(size, features, first),
            length,
            slope,
        }
    }

    /// Layers blurred by a Gaussian of this standard deviation in pixels, at the inner pixels.
    pub(super) fn blur(&self, sigma: f32, inner: &Inner, layers: &[&Batches]) -> Vec<Batches> {
        self.blur_in_steps::<1>(sigma, inner, layers)
    }

    /// The same from every `STEP`th pixel in both directions, for layers that are blurred already: Dammertz et al., *Edge-Avoiding
    /// À-Trous Wavelet Transform for fast Global Illumination Filtering*, High Performance Graphics 2010.
    pub(super) fn blur_in_steps<const STEP: usize>(
        &self,
        sigma: f32,
        inner: &Inner,
        layers: &[&Batches],
    ) -> Vec<Batches> {
        let (width, height) = self.size;
        let step = STEP as isize;
        let radius = reach(sigma) as isize / step * step;
        let most = (REACH * sigma).powi(2);
        // Rows of the disk: how far each reaches.
        let rows: Vec<(isize, isize)> = (-radius..=radius)
            .step_by(STEP)
            .filter_map(|dy| {
                let half = (most - (dy * dy) as f32).max(-1.0);
                (half >= 0.0).then(|| (dy, (half.sqrt() as isize).min(radius) / step * step))
            })
            .collect();
        let (w, h) = inner.size;
        let mut out: Vec<Batches> = layers.iter().map(|_| Vec::with_capacity(w * h)).collect();
        // Weights of the neighbours in a row of the disks around a row of pixels, those at one step after another: long
        // loops, however short the rows are.
        let mut weights = vec![0.0f32; (2 * radius as usize / STEP + 1) * w];
        let mut row_sums = vec![0.0f32; w];
        let mut all = vec![0.0f32; w];
        let mut light = vec![[Vec3A::ZERO; BATCHES]; layers.len() * w];
        for y in inner.origin.1..inner.origin.1 + h {
            all.fill(0.0);
            light.fill([Vec3A::ZERO; BATCHES]);
            for &(dy, half) in &rows {
                let v = y as isize + dy;
                if v < 0 || v >= height as isize {
                    continue;
                }
                row_sums.fill(0.0);
                let steps = (-half..=half).step_by(STEP);
                for (dx, weights) in steps.zip(weights.chunks_exact_mut(w)) {
                    let Some((skipped, count)) = inside(inner, dx) else {
                        continue;
                    };
                    let pixels = y * width + inner.origin.0 + skipped;
                    let weights = &mut weights[skipped..skipped + count];
                    let others = (v * width as isize) as usize;
                    let others = others + (inner.origin.0 + skipped).wrapping_add_signed(dx);
                    self.weights(sigma, (dx * dx + dy * dy) as f32, pixels, others, weights);
                    let sums = &mut row_sums[skipped..skipped + count];
                    sums.iter_mut().zip(weights).for_each(|(sum, w)| *sum += *w);
                }
                all.iter_mut().zip(&row_sums).for_each(|(a, s)| *a += *s);
                for x in 0..w {
                    let at = (inner.origin.0 + x) as isize;
                    // Steps to the first and the last pixel of the row that is there.
                    let first = (half - at).max(0) as usize;
                    let first = first.div_ceil(STEP);
                    let last = (half + half.min(width as isize - 1 - at)) as usize / STEP;
                    let from = (at - half) + (first * STEP) as isize;
                    let start = v as usize * width + from as usize;
                    let weights = weights[first * w + x..].iter().step_by(w);
                    let count = (last - first) * STEP + 1;
                    for (sum, layer) in light[x * layers.len()..].iter_mut().zip(layers) {
                        let mut row = *sum;
                        let neighbours = &layer[start..start + count];
                        let neighbours = neighbours.iter().step_by(STEP);
                        for (light, &weight) in neighbours.zip(weights.clone()) {
                            for b in 0..BATCHES {
                                row[b] += weight * light[b];
                            }
                        }
                        *sum = row;
                    }
                }
            }
            for (sums, all) in light.chunks_exact(layers.len().max(1)).zip(&all) {
                let share = 1.0 / all;
                for (out, sum) in out.iter_mut().zip(sums) {
                    out.push(sum.map(|s| s * share));
                }
            }
        }
        out
    }

    /// Weights of neighbours at one step from pixels beside one another, of which the squared length is `d2`; `pixels` and
    /// `others` are the first of both.
    #[inline]
    fn weights(&self, sigma: f32, d2: f32, pixels: usize, others: usize, weights: &mut [f32]) {
        let count = weights.len();
        let (scale, distance) = (0.5 / (sigma * sigma), d2.sqrt());
        let add = |weights: &mut [f32], plane: &[f32]| {
            let pairs = plane[pixels..pixels + count].iter();
            let pairs = pairs.zip(&plane[others..others + count]);
            for (weight, (own, other)) in weights.iter_mut().zip(pairs) {
                *weight += (other - own) * (other - own);
            }
        };
        let (normals, reflectance) = self.planes.split_at(3);
        weights.fill(0.0);
        normals.iter().for_each(|plane| add(weights, plane));
        let lengths = self.length[pixels..pixels + count].iter();
        let lengths = lengths.zip(&self.length[others..others + count]);
        let slopes = self.slope[pixels..pixels + count].iter();
        let slopes = slopes.zip(&self.spread[pixels..pixels + count]);
        for (weight, ((own, other), ([here, slope], spread))) in
            weights.iter_mut().zip(lengths.zip(slopes))
        {
            let step = (other - own) / (here + slope * distance);
            // A pixel that shows several surfaces takes light of each.
            *weight = (*weight - spread).max(0.0) + d2 * scale + 0.5 * step * step;
        }
        reflectance.iter().for_each(|plane| add(weights, plane));
        for weight in weights.iter_mut() {
            *weight = negative_exponential(*weight);
        }
    }
}

/// Cells on each side that a pixel takes values from.
const AROUND: usize = 2;

/// Standard deviation of their distances, in cells.
const CELLS: f32 = 1.25;

impl Guide {
    /// The mean of values of the cells around a pixel that show its surface. The pixel by its place in this guide, the cells, of
    /// `edge` pixels a side, by theirs, and where the pixel lies among them.
    pub(super) fn of_cells(
        &self,
        (x, y): Size,
        cells: &Self,
        place: Size,
        edge: usize,
        values: &[Vec3A],
    ) -> Vec3A {
        let pixel = y * self.size.0 + x;
        let around = |at: usize, end: usize| {
            (at / edge).saturating_sub(AROUND)..(at / edge + AROUND + 1).min(end)
        };
        let centre = |cell: usize| (cell * edge) as f32 + 0.5 * (edge - 1) as f32;
        let scale = 0.5 / (CELLS * edge as f32).powi(2);
        let [here, slope] = self.slope[pixel];
        let (mut sum, mut all) = (Vec3A::ZERO, 0.0);
        for v in around(place.1, cells.size.1) {
            for u in around(place.0, cells.size.0) {
                let cell = v * cells.size.0 + u;
                let (dx, dy) = (centre(u) - place.0 as f32, centre(v) - place.1 as f32);
                let d2 = dx * dx + dy * dy;
                let planes = self.planes.iter().zip(&cells.planes);
                let normals: f32 = planes.map(|(a, b)| (a[pixel] - b[cell]).powi(2)).sum();
                let step = (cells.length[cell] - self.length[pixel]) / (here + slope * d2.sqrt());
                let surface = (normals - self.spread[pixel]).max(0.0) + 0.5 * step * step;
                let weight = negative_exponential(surface + d2 * scale);
                sum += weight * values[cell];
                all += weight;
            }
        }
        sum / all
    }
}

/// exp(−x) for x ≥ 0 within 0.01 %, and 2⁻⁶⁰ from there on: no branch, and no number that is too small to be fast.
#[inline(always)]
fn negative_exponential(x: f32) -> f32 {
    // 1.5 · 2²³: adding it rounds to a whole number in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let power = (x * -std::f32::consts::LOG2_E).max(-60.0);
    let whole = power + ROUND;
    let part = power - (whole - ROUND);
    let higher = 0.240_23 + part * (0.055_5 + part * 0.009_67);
    let fraction = 1.0 + part * (std::f32::consts::LN_2 + part * higher);
    f32::from_bits(fraction.to_bits().wrapping_add(whole.to_bits() << 23))
}

/// Pixels of a row that have a neighbour so many pixels to the right: how many are skipped, and how many follow.
fn inside(inner: &Inner, dx: isize) -> Option<(usize, usize)> {
    let (origin, w) = (inner.origin.0 as isize, inner.size.0 as isize);
    let from = (-dx - origin).clamp(0, w);
    let to = (inner.width as isize - dx - origin).clamp(0, w);
    (to > from).then_some((from as usize, (to - from) as usize))
}

/// A rectangle of the pixels of a larger one.
#[derive(Clone, Copy)]
pub(super) struct Inner {
    /// Its first pixel.
    pub(super) origin: Size,
    /// Its pixels.
    pub(super) size: Size,
    /// Width of the larger one.
    pub(super) width: usize,
}

impl Inner {
    /// As large a part of the larger rectangle, of this height, as lies within so many pixels of this one.
    pub(super) fn grown(&self, around: usize, height: usize) -> Self {
        let range = |start: usize, length: usize, end: usize| {
            let from = start.saturating_sub(around);
            (from, (start + length + around).min(end) - from)
        };
        let (x, w) = range(self.origin.0, self.size.0, self.width);
        let (y, h) = range(self.origin.1, self.size.1, height);
        Self {
            origin: (x, y),
            size: (w, h),
            width: self.width,
        }
    }

    /// Numbers of its pixels in the larger one, row by row.
    pub(super) fn pixels(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        let Self {
            origin,
            size,
            width,
        } = *self;
        (0..size.1).flat_map(move |y| {
            let row = (origin.1 + y) * width + origin.0;
            row..row + size.0
        })
    }

    /// Its part of a plane.
    pub(super) fn of<T: Copy>(&self, plane: &[T]) -> Vec<T> {
        self.pixels().map(|i| plane[i]).collect()
    }
}
