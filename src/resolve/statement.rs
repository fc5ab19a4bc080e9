//! The error that is estimated and stated with a picture.
//!
//! **The average error** is the mean absolute relative error. Samples can estimate it, because a few pixels with missed
//! light do not dominate it. Two halves of the samples, with the choice of all, differ by their noise. Bias and missed
//! light are common to both, and nearly everywhere the same share of the error. So the error is the noise times a
//! constant.
//!
//! **The root** of the relMSE is dominated by bright samples. The squared error of a pixel is its variance over its
//! squared brightness + ε, as in relMSE. A pixel's own mean is as noisy as its variance: where light comes as rare hits
//! both are large or both are small, and their quotient is at most about 1 for hits of any size. So the brightness is
//! pooled over the smallest block of pixels, of 2, 4, 8 and so on a side, whose mean is known to half of itself. A
//! black picture has an error of 1, although its samples give no evidence of the light that is there.
//!
//! **The error map** is the average error pixel by pixel. The noise of a pixel is estimated from three differences of
//! its halves, some of which are small by chance. So the map is smoothed by a tent of two pixels, which keeps its mean.

use super::filter::{Size, tent};
use crate::image::film::Film;
use crate::image::relative::{EPSILON, mean_of, relative_errors};
use crate::math::moments::Moments;
use crate::math::{DVec3, Rgb};

/// Relative standard error at which the mean of a block counts as known: that of four hits. Of the blocks and bounds
/// tried on scenes of caustics at 32 samples these are nearest to the true error: 0.76 to 2.6 of its square.
const KNOWN: f64 = 0.5;

/// Ratio of a pixel's mean absolute error to the mean absolute noise between halves: bias and missed light, which both
/// share, are the same share nearly everywhere. The inverse of the median, measured in docs/lab/average_error.md.
const ERROR_RATIO: f64 = 1.65;

/// The same ratio for raw means, without blurs and roughening, whose noise is estimated from their variance.
const RAW_ERROR_RATIO: f64 = 1.1;

/// Factor on the average error if a picture's variance is multiplied by `variance`. `chosen` is true for a choice among
/// levels and blurs, false for raw means. The squared stated error beyond noise stays.
pub fn error_of_less_noise(variance: f64, chosen: bool) -> f64 {
    let stated: f64 = if chosen { ERROR_RATIO } else { RAW_ERROR_RATIO };
    (1.0 + (variance - 1.0) / (stated * stated)).sqrt()
}

/// Radius in pixels over which the error map is smoothed.
const RADIUS: usize = 1;

/// Mean absolute value over standard deviation, of normal numbers: √(2/π).
const ABSOLUTE: f64 = 0.797_884_560_8;

/// Stated error of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statement {
    /// Average error: the expected [mean relative error](relative_errors), at most 1. Infinite with too few samples for
    /// an estimate.
    pub mean: f64,
    /// Expected root of the relMSE. Infinite with too few samples for an estimate.
    pub root: f64,
    /// Relative standard error of `root`², 1 / √n if n pixels carry it: above about 0.3 few bright samples decide.
    pub doubt: f64,
}

impl Statement {
    /// The error is unknown.
    pub(super) const UNKNOWN: Self = Self {
        mean: f64::INFINITY,
        root: f64::INFINITY,
        doubt: f64::INFINITY,
    };

    /// Error of a black picture.
    pub(super) const BLACK: Self = Self {
        mean: 1.0,
        root: 1.0,
        doubt: 1.0,
    };

    /// Statement of squared relative errors of pixels and an average error.
    fn of(squares: impl Iterator<Item = f64>, mean: f64) -> Self {
        let (mut sum, mut fourth, mut count) = (0.0, 0.0, 0u64);
        for square in squares {
            sum += square;
            fourth += square * square;
            count += 1;
        }
        Self {
            mean,
            root: (sum / count.max(1) as f64).sqrt(),
            doubt: if sum > 0.0 { fourth.sqrt() / sum } else { 0.0 },
        }
    }

    /// Statement of squared relative errors and mean absolute noise, see [`Resolved::noise`](super::Resolved::noise).
    pub(super) fn of_resolved(
        squares: impl Iterator<Item = f64>,
        picture: &[Rgb],
        noise: &[f32],
    ) -> Self {
        Self::of(squares, mean_of(errors_of_resolved(picture, noise)))
    }

    /// Upper bound of the average error, raised as the root is by two standard errors of its square.
    pub(crate) fn bound(&self) -> f64 {
        self.mean * (1.0 + 2.0 * self.doubt).sqrt()
    }

    /// The statement with missing light added: `squares` are squared missing shares of all pixels.
    pub(crate) fn with_missing(self, squares: &[f32]) -> Self {
        let count = squares.len().max(1) as f64;
        let sum: f64 = squares.iter().map(|&x| f64::from(x)).sum();
        let dark: f64 = squares.iter().map(|&x| f64::from(x).sqrt().min(1.0)).sum();
        Self {
            mean: (self.mean + dark / count).min(self.mean.max(1.0)),
            root: (self.root * self.root + sum / count).sqrt(),
            ..self
        }
    }
}

/// The statement of a film of one level.
pub(crate) fn film_error(film: &Film) -> Statement {
    match state(film) {
        State::Unknown => Statement::UNKNOWN,
        State::Black => Statement::BLACK,
        State::Lit => Statement::of(squares(film), mean_of(errors_of_film(film))),
    }
}

/// Error map of a film of one level: expected relative error of every pixel, without the bias of merges. Its mean is
/// the [average error](film_error), up to effects at the border. `None` with too few samples.
pub(crate) fn film_errors(film: &Film) -> Option<Vec<f32>> {
    let size = (film.window.w as usize, film.window.h as usize);
    match state(film) {
        State::Unknown => None,
        State::Black => Some(vec![1.0; film.pixels.len()]),
        State::Lit => Some(smoothed(size, errors_of_film(film))),
    }
}

/// The error map of expected relative errors of pixels.
pub(super) fn smoothed(size: Size, errors: impl Iterator<Item = f64>) -> Vec<f32> {
    let mut errors = errors.map(|error| error as f32).collect::<Vec<_>>();
    tent(size, RADIUS, &mut errors);
    errors
}

/// Expected relative errors of the pixels of a picture with this mean absolute noise.
pub(super) fn errors_of_resolved(picture: &[Rgb], noise: &[f32]) -> impl Iterator<Item = f64> {
    let light = picture.iter().map(|p| f64::from(p.element_sum()));
    let noise = noise.iter().map(|&noise| ERROR_RATIO * f64::from(noise));
    relative_errors(light, noise)
}

/// Expected relative errors of the pixels of raw means.
fn errors_of_film(film: &Film) -> impl Iterator<Item = f64> {
    let light = film.pixels.iter().map(|m| m.mean.element_sum());
    let deviation = |m: &Moments| m.variance_of_mean().map(f64::sqrt).element_sum();
    let noise = (film.pixels.iter()).map(move |m| RAW_ERROR_RATIO * ABSOLUTE * deviation(m));
    relative_errors(light, noise)
}

/// Kinds of films for which a statement differs.
enum State {
    Unknown,
    Black,
    Lit,
}

fn state(film: &Film) -> State {
    if film.pixels.iter().any(|m| m.n < 2) {
        State::Unknown
    } else if film.pixels.iter().all(|m| m.mean == DVec3::ZERO) {
        State::Black
    } else {
        State::Lit
    }
}

/// Squared relative errors of the pixels of a film that is not black.
fn squares(film: &Film) -> impl Iterator<Item = f64> {
    let size = (film.window.w as usize, film.window.h as usize);
    let pixels = film.pixels.iter().map(|m| Block {
        pixels: 1.0,
        sum: m.mean,
        variance: m.variance_of_mean().element_sum(),
    });
    let mut pyramid = vec![Blocks::halved(size, pixels)];
    while let Some(last) = pyramid.last()
        && last.blocks.len() > 1
    {
        let above = Blocks::halved(last.size, last.blocks.iter().copied());
        pyramid.push(above);
    }
    let squared = move |x: usize, y: usize| {
        let mut blocks = (1..)
            .zip(&pyramid)
            .map(|(k, blocks)| blocks.at(x >> k, y >> k));
        let known = blocks.find(|block| block.is_known());
        let block = known.or(pyramid[pyramid.len() - 1].blocks.first());
        block.map_or(DVec3::ZERO, Block::square)
    };
    let pixels = film.pixels.iter().enumerate();
    pixels.map(move |(i, m)| {
        let square = squared(i % size.0, i / size.0);
        (m.variance_of_mean() / (square + EPSILON)).element_sum() / 3.0
    })
}

/// Sums over a block of pixels.
#[derive(Clone, Copy, Default)]
struct Block {
    pixels: f64,
    sum: DVec3,
    /// Variance of the sum, summed over channels.
    variance: f64,
}

impl Block {
    /// The squared brightness, corrected for the noise in the square of a mean.
    fn square(&self) -> DVec3 {
        let noise = self.variance / self.sum.length_squared().max(f64::MIN_POSITIVE);
        let mean = self.sum / self.pixels;
        mean * mean * (1.0 - noise).max(1.0 - KNOWN * KNOWN)
    }

    /// True if the mean is known well enough to divide by, or there is no noise.
    fn is_known(&self) -> bool {
        self.variance <= (KNOWN * self.sum).length_squared()
    }
}

/// A picture in blocks.
struct Blocks {
    size: (usize, usize),
    blocks: Vec<Block>,
}

impl Blocks {
    fn at(&self, x: usize, y: usize) -> &Block {
        &self.blocks[y * self.size.0 + x]
    }

    /// Blocks of twice the side; `all` are the blocks of a picture of this size in blocks.
    fn halved((width, height): (usize, usize), all: impl Iterator<Item = Block>) -> Self {
        let size = (width.div_ceil(2), height.div_ceil(2));
        let mut blocks = vec![Block::default(); size.0 * size.1];
        for (i, block) in all.enumerate() {
            let sum = &mut blocks[i / width / 2 * size.0 + i % width / 2];
            sum.pixels += block.pixels;
            sum.sum += block.sum;
            sum.variance += block.variance;
        }
        Self { size, blocks }
    }
}
