//! A layer of light at a coarse scale: means over cells of 4 × 4 pixels of the whole picture, which give the size of
//! its hits and its energy.
//!
//! The light of a level can come as rare hits. If a window expects less than about one hit, the sample variance is zero
//! or huge, and never right. With x the batch means of a pixel, R_j the mean of level j, R_K that of the roughest:
//!
//! ```text
//! M_j = largest over two radii of tent(Σ x²) / tent(Σ x), of level j and of rougher ones    the size of a hit
//! D_j = max(0, tent(R_K) − tent(R_j))                                                       light that level j has not met
//! e_j = n B tent(R_K) / M_j                                                                 hits that n pixels should hold
//! V_j + D_j M_j / (n' B) exp(−e_j)                                                          the variance
//! ```
//!
//! n' is the number of averaged pixels. If hits are expected but none occur, the pixels are dark and the exponential is
//! near zero. If no hit is expected, its absence is no evidence of darkness.
//!
//! At the scale of energies the variance of a level is at least the square of the light that it has
//! [missed](missed_light): a level without any hit of the sun has only the light of the sky, which looks well sampled.

use super::filter::{Size, tent};
use super::layer::{Batches, median, squared_difference, variance_of_mean};
use crate::image::level_film::{BATCHES, LevelFilm};
use crate::math::{Rgb, Vec3A};
use rayon::prelude::*;

/// Pixels a side of a cell.
pub(super) const CELL: usize = 4;

/// Radii in cells at which the size of hits is taken: about 6 and 12 pixels.
const RADII_OF_HITS: [usize; 2] = [1, 3];

/// n: pixels of the window of the choice.
const WINDOW: f32 = 12.0;

/// Radius in cells at which energy is compared.
const RADIUS: usize = 3;

/// Radius in cells at which energy is restored.
const SMOOTH: usize = 1;

/// Pixels that the tent of [`RADIUS`] averages: 1 / Σ w², with n = 28 and Σ w² = (2 n² + 1) / (3 n³) along each side.
const AVERAGED: f32 = 1762.0;

/// Least and largest factor that restores energy. If plain paths have found a sun under water in a few hits, blurs have
/// lost most of its light.
pub(super) const FACTORS: [f32; 2] = [0.5, 16.0];

/// Multiple of a difference's variance that counts as noise: a smaller one would spread the light of two or three hits.
const DOUBT: f32 = 2.0;

/// Cap of a batch in blurs, as a multiple of the median of the batches around.
const CAP_PER_MEDIAN: f32 = 10.0;

/// Multiple of the mean hit of a wider area that is added to the cap: if most batches are black, hits are usual.
const CAP_PER_HIT: f32 = 4.0;

/// Least share of a level's missing light that the next level adds, if that light was missed and is no bias.
const AT_ONCE: f32 = 0.8;

/// Share of the light below which differences are rounding.
const ROUNDING: f32 = 1e-4;

/// Light of some levels in cells.
pub(super) struct Coarse {
    pixels: Size,
    cells: Size,
    /// Means of the batches in every cell, by level.
    levels: Vec<[Vec<Vec3A>; BATCHES]>,
    /// B: number of leading batches that have samples.
    pub(super) count: usize,
    /// M of every cell, by level.
    hits: Vec<Vec<f32>>,
}

impl Coarse {
    /// The light of roughened vertices at every level of a film.
    pub(super) fn roughened(film: &LevelFilm) -> Self {
        let shared = film.levels();
        Self::of(film, shared, |pixel, batch, level| {
            let light =
                film.batch_mean(pixel, batch, level) - film.batch_mean(pixel, batch, shared);
            light.max(Rgb::ZERO).into()
        })
    }

    /// The light that all levels of a film share, as one level.
    pub(super) fn shared(film: &LevelFilm) -> Self {
        Self::of(film, 1, |pixel, batch, _| {
            film.batch_mean(pixel, batch, film.levels()).into()
        })
    }

    /// Light by pixel, batch and level.
    fn of(
        film: &LevelFilm,
        levels: usize,
        light: impl Fn(usize, usize, usize) -> Vec3A + Sync,
    ) -> Self {
        let window = film.window();
        let pixels = (window.w as usize, window.h as usize);
        let cells = (pixels.0.div_ceil(CELL), pixels.1.div_ceil(CELL));
        let cell = |level: usize, cell: usize| {
            let inside = pixels_of(pixels, cells, cell);
            let part = 1.0 / inside.clone().count() as f32;
            let (mut means, mut moments) = ([Vec3A::ZERO; BATCHES], [0.0f32; 2]);
            for pixel in inside {
                for (batch, mean) in means.iter_mut().enumerate() {
                    let light = light(pixel, batch, level);
                    *mean += part * light;
                    let grey = light.element_sum() / 3.0;
                    moments[0] += part * grey;
                    moments[1] += part * grey * grey;
                }
            }
            (means, moments)
        };
        let level = |level: usize| {
            let all = (0..cells.0 * cells.1).into_par_iter();
            let all: Vec<_> = all.map(|number| cell(level, number)).collect();
            let means = std::array::from_fn(|b| all.iter().map(|(means, _)| means[b]).collect());
            let moments = [0, 1].map(|m| all.iter().map(|(_, moments)| moments[m]).collect());
            (means, size_of_hits(cells, &moments))
        };
        let all: Vec<_> = (0..levels).into_par_iter().map(level).collect();
        let (levels, mut hits): (Vec<_>, Vec<Vec<f32>>) = all.into_iter().unzip();
        // For levels without a hit: the same light comes in hits at least as large as a rougher level's.
        for k in (1..hits.len()).rev() {
            let (sharper, rougher) = hits.split_at_mut(k);
            let pairs = sharper[k - 1].iter_mut().zip(&rougher[0]);
            pairs.for_each(|(sharp, rough)| *sharp = sharp.max(*rough));
        }
        Self {
            pixels,
            cells,
            levels,
            count: film.batches(),
            hits,
        }
    }

    /// Light that each level has missed around a pixel of the whole picture, given all levels' light at two scales.
    pub(super) fn missing(
        &self,
        pixel: (usize, usize),
        light: impl Fn(usize) -> [Vec3A; 2],
    ) -> impl Iterator<Item = Missing> {
        let roughest = light(self.levels.len() - 1);
        let corners = Corners::of(self.cells, pixel);
        self.hits.iter().enumerate().map(move |(level, hits)| {
            let size = corners.mean(hits);
            let light = light(level);
            // Beside a hit the wider scale has light, and the narrow one has none.
            let [wide, narrow] = std::array::from_fn(|scale| roughest[scale] - light[scale]);
            Missing {
                variance: wide.max(narrow).max(Vec3A::ZERO) * size / self.count as f32,
                expected: self.expected(WINDOW, roughest[0], size),
            }
        })
    }

    /// Factors that bring a picture, given by pixel, to the energy of the best level at this scale. It is chosen by the
    /// rule for levels, where a level that is too dark for its expected hits counts as noisy.
    pub(super) fn energy(mut self, picture: impl Fn(usize) -> Vec3A + Sync) -> Energy {
        let (pixels, cells) = (self.pixels, self.cells);
        (self.levels.par_iter_mut().flatten()).for_each(|plane| tent(cells, RADIUS, plane));
        let mut have = self.means(picture);
        tent(cells, RADIUS, &mut have);
        let factors = have.par_iter().enumerate();
        let mut factors: Vec<Vec3A> = factors
            .map(|(cell, have)| self.factor(cell, *have))
            .collect();
        tent(cells, SMOOTH, &mut factors);
        Energy {
            cells,
            width: pixels.0,
            factors,
        }
    }

    /// The factor of a cell in which the picture has the light `have`, for smoothed levels.
    fn factor(&self, cell: usize, have: Vec3A) -> Vec3A {
        let levels = &self.levels;
        let batches: Vec<[Vec3A; BATCHES]> = levels
            .iter()
            .map(|level| level.each_ref().map(|batch| batch[cell]))
            .collect();
        let count = self.count;
        let mean = |batches: &[Vec3A; BATCHES]| batches.iter().sum::<Vec3A>() / count as f32;
        let means: Vec<Vec3A> = batches.iter().map(mean).collect();
        let roughest = means[levels.len() - 1];
        let noise: Vec<f32> = (0..levels.len())
            .map(|level| {
                let size = self.hits[level][cell];
                let missing = (roughest - means[level]).max(Vec3A::ZERO) * size
                    / (count as f32 * AVERAGED)
                    * (-self.expected(AVERAGED, roughest, size)).exp();
                let sampled = grey(variance_of_mean(&batches[level][..count]) + missing);
                sampled.max(missed_light(&means[level..]).powi(2))
            })
            .collect();
        let error = |level: usize| {
            let bias = (0..level).map(|anchor| {
                let d: [_; BATCHES] =
                    std::array::from_fn(|b| batches[level][b] - batches[anchor][b]);
                grey(squared_difference(&d[..count])) - noise[anchor]
            });
            bias.fold(0.0, f32::max) + noise[level]
        };
        let best =
            (1..levels.len()).fold(0, |best, k| if error(k) < error(best) { k } else { best });
        let variance = variance_of_mean(&batches[best][..count]);
        restoring_factor(have, means[best] - have, variance)
    }

    /// Expected hits in a number of pixels with this light, where each hit has this size.
    fn expected(&self, pixels: f32, light: Vec3A, size: f32) -> f32 {
        pixels * self.count as f32 * grey(light) / size.max(f32::MIN_POSITIVE)
    }

    /// Columns and rows of cells.
    pub(super) fn cells(&self) -> Size {
        self.cells
    }

    /// Batches of every cell of the first level.
    pub(super) fn batches(&self) -> Batches {
        let cells = 0..self.cells.0 * self.cells.1;
        let of = |cell: usize| self.levels[0].each_ref().map(|batch| batch[cell]);
        cells.map(of).collect()
    }

    /// Means of a picture, given by pixel, over every cell.
    pub(super) fn means(&self, picture: impl Fn(usize) -> Vec3A + Sync) -> Vec<Vec3A> {
        let of = |cell: usize| {
            let inside = pixels_of(self.pixels, self.cells, cell);
            let count = inside.clone().count() as f32;
            inside.map(&picture).sum::<Vec3A>() / count
        };
        let cells = 0..self.cells.0 * self.cells.1;
        cells.into_par_iter().map(of).collect()
    }
}

/// Light that the first of these levels, the sharpest, has missed; 0 if rougher levels may be brighter by their bias. A
/// bias grows up to the last level. Missed light appears at the next level, and later levels add hardly any.
fn missed_light(means: &[Vec3A]) -> f32 {
    let [first, next, .., last] = means else {
        return 0.0;
    };
    let [lacks, comes] = [last, next].map(|level| grey(*level) - grey(*first));
    if comes > AT_ONCE * lacks {
        lacks.max(0.0)
    } else {
        0.0
    }
}

/// Mean of the channels.
fn grey(light: Vec3A) -> f32 {
    light.element_sum() / 3.0
}

/// The factor that raises the light `have` by the part of `more` that is significant against this variance.
pub(super) fn restoring_factor(have: Vec3A, more: Vec3A, variance: Vec3A) -> Vec3A {
    let floor = have * ROUNDING;
    let noise = DOUBT * (variance + floor * floor);
    let square = (more * more).max(Vec3A::splat(f32::MIN_POSITIVE));
    let kept = (Vec3A::ONE - noise / square).max(Vec3A::ZERO);
    let ratio = Vec3A::ONE + more * kept / have.max(Vec3A::splat(f32::MIN_POSITIVE));
    let [least, most] = FACTORS.map(Vec3A::splat);
    ratio.clamp(least, most)
}

/// Light that a level has missed around a pixel.
pub(super) struct Missing {
    /// Its variance, if no hit is expected.
    pub(super) variance: Vec3A,
    /// Hits that are expected in the window of the choice.
    pub(super) expected: f32,
}

impl Missing {
    /// Variance to add to an average over `times` as many pixels.
    pub(super) fn noise(&self, times: f32) -> Vec3A {
        self.variance * (-self.expected * times).exp()
    }
}

/// Factors on the light of every pixel.
pub(super) struct Energy {
    cells: Size,
    width: usize,
    factors: Vec<Vec3A>,
}

impl Energy {
    /// The factor of a pixel, which counts row by row.
    pub(super) fn at(&self, pixel: usize) -> Vec3A {
        let corners = Corners::of(self.cells, (pixel % self.width, pixel / self.width));
        corners.mean(&self.factors)
    }
}

/// Caps of the light of batches in blurs: light above them counts as fireflies.
pub(super) struct Caps {
    cells: Size,
    most: Vec<Vec3A>,
}

impl Caps {
    /// The cap of every pixel, for light by pixel and batch: a multiple of the median of the batches around, plus one of
    /// the mean of those that are not black.
    pub(super) fn of(film: &LevelFilm, light: impl Fn(usize, usize) -> Vec3A + Sync) -> Self {
        let window = film.window();
        let pixels = (window.w as usize, window.h as usize);
        let cells = (pixels.0.div_ceil(CELL), pixels.1.div_ceil(CELL));
        let batches = film.batches();
        let of_cell = |cell: usize| {
            let inside = pixels_of(pixels, cells, cell);
            let part = 1.0 / inside.clone().count() as f32;
            let (mut typical, mut sum, mut count) = (Vec3A::ZERO, Vec3A::ZERO, 0u32);
            for pixel in inside {
                let light: [Vec3A; BATCHES] = std::array::from_fn(|batch| light(pixel, batch));
                typical += part * median(&light[..batches]);
                sum += light.iter().sum::<Vec3A>();
                let lit = light.iter().filter(|l| **l != Vec3A::ZERO);
                count += lit.count() as u32;
            }
            (typical, (part * sum, part * count as f32))
        };
        let all = (0..cells.0 * cells.1).into_par_iter().map(of_cell);
        let (mut medians, (mut means, mut lit)): (Vec<_>, (Vec<_>, Vec<_>)) = all.unzip();
        tent(cells, 1, &mut medians);
        tent(cells, 2, &mut means);
        tent(cells, 2, &mut lit);
        let most = medians.iter().zip(&means).zip(&lit);
        Self {
            cells,
            most: most
                .map(|((median, mean), lit)| {
                    // Without a hit around, the mean hit would be 0/0.
                    let of_hits = if *lit > 0.0 { CAP_PER_HIT / lit } else { 0.0 };
                    *median * CAP_PER_MEDIAN + *mean * of_hits
                })
                .collect(),
        }
    }

    /// The cap at a pixel of the film.
    pub(super) fn at(&self, pixel: (usize, usize)) -> Vec3A {
        Corners::of(self.cells, pixel).mean(&self.most)
    }
}

/// M of every cell, from first and second moments of all batches.
fn size_of_hits(cells: Size, moments: &[Vec<f32>; 2]) -> Vec<f32> {
    let mut sizes = vec![0.0f32; cells.0 * cells.1];
    for radius in RADII_OF_HITS {
        let [first, second] = moments.each_ref().map(|moments| {
            let mut moments = moments.clone();
            tent(cells, radius, &mut moments);
            moments
        });
        for ((size, first), second) in sizes.iter_mut().zip(first).zip(second) {
            *size = size.max(second / first.max(f32::MIN_POSITIVE));
        }
    }
    sizes
}

/// Pixels of a cell.
fn pixels_of(
    (width, height): Size,
    (columns, _): Size,
    cell: usize,
) -> impl Iterator<Item = usize> + Clone {
    let (x, y) = (cell % columns * CELL, cell / columns * CELL);
    let (right, bottom) = ((x + CELL).min(width), (y + CELL).min(height));
    (y..bottom).flat_map(move |y| (x..right).map(move |x| y * width + x))
}

/// The four cells around a pixel, and their bilinear weights.
struct Corners([(usize, f32); 4]);

impl Corners {
    fn of((columns, rows): Size, (x, y): (usize, usize)) -> Self {
        let side = |at: usize, end: usize| {
            let at = ((at as f32 + 0.5) / CELL as f32 - 0.5).clamp(0.0, (end - 1) as f32);
            let first = at as usize;
            (first, (first + 1).min(end - 1), at - first as f32)
        };
        let (left, right, u) = side(x, columns);
        let (above, below, v) = side(y, rows);
        Self([
            (above * columns + left, (1.0 - u) * (1.0 - v)),
            (above * columns + right, u * (1.0 - v)),
            (below * columns + left, (1.0 - u) * v),
            (below * columns + right, u * v),
        ])
    }

    fn mean<T: Copy + std::ops::Mul<f32, Output = T> + std::iter::Sum>(&self, plane: &[T]) -> T {
        self.0
            .iter()
            .map(|&(cell, share)| plane[cell] * share)
            .sum()
    }
}
