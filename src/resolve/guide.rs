//! Gaussian filters that stop at the edges of the surfaces that paths hit.

use super::filter::Size;
use super::layer::Batches;
use crate::image::level_film::{BATCHES, FEATURES, Features};
use crate::math::Vec3A;

/// Standard deviations that a filter reaches.
const REACH: f32 = 2.2;

/// Weight of the squared difference of normals in the exponent.
const NORMAL: f32 = 10.0;

/// Difference of reflectance that counts as one standard deviation.
const ALBEDO: f32 = 0.1;

/// Share of a length that counts as one standard deviation of lengths.
const LENGTH: f32 = 0.02;

/// The surface whose edges stop a filter.
#[derive(Clone, Copy)]
pub(super) enum Surface {
    /// The surface of the first vertex.
    First,
    /// The surface of the first rough vertex.
    Rough,
}

/// Pixels that a filter of this standard deviation reaches.
pub(super) fn reach(sigma: f32) -> usize {
    (2.0 * sigma).ceil() as usize
}

/// Data of the edges that stop a filter, one plane per number.
pub(super) struct Guide {
    size: Size,
    /// Normal of the surface and reflectance of the first one, scaled so that their squared differences add up to the
    /// exponent.
    planes: Vec<Vec<f32>>,
    /// Variance of the normals in a pixel on an edge, in the exponent.
    spread: Vec<f32>,
    length: Vec<f32>,
    /// Difference of lengths that counts as one standard deviation at a pixel.
    here: Vec<f32>,
    /// Length that a plane adds to it a pixel away.
    slope: Vec<f32>,
}

/// Variance of the normals in pixels on an edge between surfaces, times [`NORMAL`]: for unit normals it is 1 − |mean|².
/// The variance of two pixels on opposite sides is subtracted: it is not of an edge but of gloss, or of paths that
/// leave the scene.
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
    /// The normal of a surface, its distance along the path, and the reflectance of the first surface.
    pub(super) fn new(size: Size, surface: Surface, features: &[Features]) -> Self {
        let (width, height) = size;
        let first = match surface {
            Surface::Rough => 0,
            Surface::First => 4,
        };
        let plane = |at: usize, scale: f32| features.iter().map(|f| f[at] * scale).collect();
        let normals = (first..first + 3).map(|at| plane(at, NORMAL.sqrt()));
        let reflectance = (8..FEATURES).map(|at| plane(at, 0.5f32.sqrt() / ALBEDO));
        let planes = normals.chain(reflectance).collect();
        let length: Vec<f32> = plane(first + 3, 1.0);
        let slope = |i: usize| {
            let (x, y) = (i % width, i / width);
            let at = |x: usize, y: usize| length[y * width + x];
            let across = (at((x + 1).min(width - 1), y) - at(x.saturating_sub(1), y)).abs();
            let along = (at(x, (y + 1).min(height - 1)) - at(x, y.saturating_sub(1))).abs();
            0.25 * across.max(along)
        };
        let here = |length: &f32| LENGTH * length + f32::MIN_POSITIVE.sqrt();
        let here = length.iter().map(here).collect();
        let slope = (0..length.len()).map(slope).collect();
        Self {
            size,
            planes,
            spread: spread(size, features, first),
            length,
            here,
            slope,
        }
    }

    /// Weights, below 1, of the pixels to the left, to the right, above and below a pixel; 0 outside of the picture.
    pub(super) fn beside(&self, pixel: usize) -> [f32; 4] {
        let (width, height) = self.size;
        let (x, y) = (pixel % width, pixel / width);
        let weight = |there: bool, other: usize| {
            let mut weight = [0.0];
            if there {
                self.weights(1.0, 1.0, pixel, other, &mut weight);
            }
            weight[0]
        };
        [
            weight(x > 0, pixel.wrapping_sub(1)),
            weight(x + 1 < width, pixel + 1),
            weight(y > 0, pixel.wrapping_sub(width)),
            weight(y + 1 < height, pixel + width),
        ]
    }

    /// Weight, at most 1, of the pixel at an offset to the right and below a pixel by their surfaces alone, whatever
    /// the distance.
    #[inline]
    pub(super) fn alike(&self, pixel: usize, [dx, dy]: [isize; 2]) -> f32 {
        let other = pixel.wrapping_add_signed(dy * self.size.0 as isize + dx);
        let distance = (dx * dx + dy * dy) as f32;
        let apart = |plane: &Vec<f32>| plane[other] - plane[pixel];
        let (normals, reflectance) = self.planes.split_at(3);
        let normals = of_normals(|k| apart(&normals[k]), self.spread[pixel]);
        let reflectance: f32 = reflectance.iter().map(|plane| apart(plane).powi(2)).sum();
        let reach = self.here[pixel] + self.slope[pixel] * distance.sqrt();
        negative_exponential(normals + reflectance + of_lengths(apart(&self.length), reach))
    }

    /// The first `batches` of layers at the inner pixels, blurred by a Gaussian of this standard deviation in pixels,
    /// from every `STEP`th pixel in both directions. A `STEP` above 1 is for layers that are blurred already: Dammertz
    /// et al., *Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering*, High Performance
    /// Graphics 2010.
    pub(super) fn blur<const STEP: usize>(
        &self,
        sigma: f32,
        inner: &Inner,
        layers: &[&Batches],
        batches: usize,
    ) -> Vec<Batches> {
        match batches {
            2 => self.blur_of::<STEP, 2>(sigma, inner, layers),
            3 => self.blur_of::<STEP, 3>(sigma, inner, layers),
            _ => self.blur_of::<STEP, BATCHES>(sigma, inner, layers),
        }
    }

    /// [`Self::blur`] of `N` batches, without mixtures; the other batches are black.
    fn blur_of<const STEP: usize, const N: usize>(
        &self,
        sigma: f32,
        inner: &Inner,
        layers: &[&Batches],
    ) -> Vec<Batches> {
        let (width, height) = self.size;
        let step = STEP as isize;
        let radius = reach(sigma) as isize / step * step;
        let rows = disk_rows::<STEP>(sigma, radius);
        let (w, h) = inner.size;
        let mut out: Vec<Batches> = layers.iter().map(|_| Vec::with_capacity(w * h)).collect();
        // Weights of the neighbours in a row of the disks around a row of pixels, in the order of their offsets: the
        // loops are as long as the row of pixels.
        let mut weights = vec![0.0f32; (2 * radius as usize / STEP + 1) * w];
        let mut row_sums = vec![0.0f32; w];
        let mut all = vec![0.0f32; w];
        let mut light = vec![[Vec3A::ZERO; N]; layers.len() * w];
        for y in inner.origin.1..inner.origin.1 + h {
            all.fill(0.0);
            light.fill([Vec3A::ZERO; N]);
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
                    // Steps to the first and the last pixel of the row within the picture.
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
                            for b in 0..N {
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
                    let mut mean = [Vec3A::ZERO; BATCHES];
                    (mean.iter_mut().zip(sum)).for_each(|(mean, sum)| *mean = *sum * share);
                    out.push(mean);
                }
            }
        }
        out
    }

    /// Weights of neighbours at one offset, of squared length `d2`, from adjacent pixels of a row; `pixels` and
    /// `others` are the first pixel and its neighbour.
    #[inline]
    fn weights(&self, sigma: f32, d2: f32, pixels: usize, others: usize, weights: &mut [f32]) {
        let count = weights.len();
        let (scale, distance) = (0.5 / (sigma * sigma), d2.sqrt());
        let (normals, reflectance) = self.planes.split_at(3);
        let pairs = Pairs {
            own: self.part(pixels, count),
            normals: std::array::from_fn(|k| &normals[k][others..others + count]),
            length: &self.length[others..others + count],
        };
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight = pairs.normals(i) + d2 * scale + pairs.lengths(i, distance);
        }
        for plane in reflectance {
            let own = &plane[pixels..pixels + count];
            let pairs = own.iter().zip(&plane[others..others + count]);
            let pairs = weights.iter_mut().zip(pairs);
            pairs.for_each(|(weight, (own, other))| *weight += (other - own) * (other - own));
        }
        for weight in weights.iter_mut() {
            *weight = negative_exponential(*weight);
        }
    }

    /// The guides of adjacent pixels of a row.
    fn part(&self, first: usize, count: usize) -> Part<'_> {
        Part {
            normals: std::array::from_fn(|k| &self.planes[k][first..first + count]),
            spread: &self.spread[first..first + count],
            length: &self.length[first..first + count],
            here: &self.here[first..first + count],
            slope: &self.slope[first..first + count],
        }
    }
}

/// Guides of adjacent pixels of a row, as the fields of [`Guide`].
struct Part<'a> {
    normals: [&'a [f32]; 3],
    spread: &'a [f32],
    length: &'a [f32],
    here: &'a [f32],
    slope: &'a [f32],
}

/// Guides of pixels and of one neighbour each: exponents of the neighbours' weights, in loops without branches.
struct Pairs<'a> {
    own: Part<'a>,
    normals: [&'a [f32]; 3],
    length: &'a [f32],
}

impl Pairs<'_> {
    /// Exponent of the normals. A pixel that shows several surfaces takes light of all of them.
    #[inline(always)]
    fn normals(&self, i: usize) -> f32 {
        of_normals(
            |k| self.normals[k][i] - self.own.normals[k][i],
            self.own.spread[i],
        )
    }

    /// Exponent of the lengths of two pixels at this distance.
    #[inline(always)]
    fn lengths(&self, i: usize, distance: f32) -> f32 {
        let apart = self.length[i] - self.own.length[i];
        of_lengths(apart, self.own.here[i] + self.own.slope[i] * distance)
    }
}

/// Exponent of two normals by their differences along each axis, less the spread within a pixel.
#[inline(always)]
fn of_normals(apart: impl Fn(usize) -> f32, spread: f32) -> f32 {
    let square = |k: usize| {
        let apart = apart(k);
        apart * apart
    };
    (square(0) + square(1) + square(2) - spread).max(0.0)
}

/// Exponent of two lengths by their difference and the standard deviation on one surface.
#[inline(always)]
fn of_lengths(apart: f32, allowed: f32) -> f32 {
    let step = apart / allowed;
    0.5 * step * step
}

/// Cells on each side that a pixel takes values from.
const AROUND: usize = 2;

/// Standard deviation of their distances, in cells.
const CELLS: f32 = 1.25;

impl Guide {
    /// For every pixel of row `y` of this guide the mean of the values of the cells around it, weighted by how much
    /// they show its surface. The cells have `edge` pixels a side; `place` is the row in the picture of the cells.
    pub(super) fn of_cells(
        &self,
        y: usize,
        cells: &Self,
        place: usize,
        edge: usize,
        values: &[Vec3A],
    ) -> Vec<Vec3A> {
        let (width, (columns, rows)) = (self.size.0, cells.size);
        let centre = |cell: usize| (cell * edge) as f32 + 0.5 * (edge - 1) as f32;
        let scale = 0.5 / (CELLS * edge as f32).powi(2);
        let mut sums = [(); 3].map(|()| vec![0.0f32; width]);
        let (mut all, mut weights) = (vec![0.0f32; width], vec![0.0f32; width]);
        let near = place / edge;
        for v in near.saturating_sub(AROUND)..(near + AROUND + 1).min(rows) {
            let dy = centre(v) - place as f32;
            // A row of cells, repeated for every pixel, so that the loops are as long as the row of pixels.
            let wide = |value: &dyn Fn(usize) -> f32| -> Vec<f32> {
                let row = (0..columns).map(value);
                row.flat_map(|v| std::iter::repeat_n(v, edge)).collect()
            };
            let row = |plane: &[f32]| wide(&|u| plane[v * columns + u]);
            let normals: [_; 3] = std::array::from_fn(|k| row(&cells.planes[k]));
            let (length, centres) = (row(&cells.length), wide(&centre));
            let light: [_; 3] = std::array::from_fn(|c| wide(&|u| values[v * columns + u][c]));
            for shift in (0..=2 * AROUND).map(|step| step * edge) {
                let most = AROUND * edge;
                let first = most.saturating_sub(shift);
                let end = (columns * edge + most).saturating_sub(shift).min(width);
                if first >= end {
                    continue;
                }
                let others = first + shift - most..end + shift - most;
                let weights = &mut weights[first..end];
                let pairs = Pairs {
                    own: self.part(y * width + first, end - first),
                    normals: normals.each_ref().map(|plane| &plane[others.clone()]),
                    length: &length[others.clone()],
                };
                let centres = &centres[others.clone()];
                for (i, weight) in weights.iter_mut().enumerate() {
                    let dx = centres[i] - (first + i) as f32;
                    let d2 = dx * dx + dy * dy;
                    let surface = pairs.normals(i) + pairs.lengths(i, d2.sqrt());
                    *weight = negative_exponential(surface + d2 * scale);
                }
                let all = all[first..end].iter_mut().zip(&*weights);
                all.for_each(|(all, weight)| *all += *weight);
                for (sum, light) in sums.iter_mut().zip(&light) {
                    let lit = weights.iter().zip(&light[others.clone()]);
                    let sum = sum[first..end].iter_mut().zip(lit);
                    sum.for_each(|(sum, (weight, light))| *sum += weight * light);
                }
            }
        }
        let mean = |x: usize| Vec3A::from_array([0, 1, 2].map(|c| sums[c][x])) / all[x];
        (0..width).map(mean).collect()
    }
}

/// exp(−x) for x ≥ 0 within 0.01 %, at least 2⁻⁶⁰: without a branch, and without denormal numbers, which are slow.
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

/// Rows of a blur's disk, `STEP` pixels apart: the offset and the half width of each.
fn disk_rows<const STEP: usize>(sigma: f32, radius: isize) -> Vec<(isize, isize)> {
    let step = STEP as isize;
    let most = (REACH * sigma).powi(2);
    let row = |dy: isize| {
        let half = (most - (dy * dy) as f32).max(-1.0);
        (half >= 0.0).then(|| (dy, (half.sqrt() as isize).min(radius) / step * step))
    };
    (-radius..=radius).step_by(STEP).filter_map(row).collect()
}

/// Pixels of a row that have a neighbour `dx` pixels to the right: the number skipped before them, and their number.
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
    /// This rectangle with a border of `around` pixels, within the larger one, which has this height.
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

    /// Number in the larger one of one of its own pixels.
    pub(super) fn number(&self, pixel: usize) -> usize {
        let (x, y) = (pixel % self.size.0, pixel / self.size.0);
        (self.origin.1 + y) * self.width + self.origin.0 + x
    }

    /// Its part of a plane.
    pub(super) fn of<T: Copy>(&self, plane: &[T]) -> Vec<T> {
        let mut part = Vec::with_capacity(self.size.0 * self.size.1);
        part.extend(self.pixels().map(|i| plane[i]));
        part
    }
}
