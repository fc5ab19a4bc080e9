//! The level of roughening chosen per pixel, without a reference, from levels on the same paths in independent batches.
//!
//! Goldenshluger and Lepski's principle (*Bandwidth selection in kernel density estimation*, Annals of Statistics 39(3),
//! 2011): a level is biased where it differs from a less roughened one by more than that one's noise. With I_k the picture
//! of level k in B batches, D = I_k − I_j in each of them, and tent_r a box filter of radius r applied twice:
//!
//! ```text
//! V_k  = tent_r(variance of the mean of level k)
//! w    = 1 / (I~² + 0.01)        I~ the roughest level, smoothed by tent_r, where the mean of the picture counts as 0.3
//! U_kj = [(Σ D)² − Σ D²] / (B (B − 1))                     unbiased for the squared difference
//! b_k  = max over j < k of w tent_r(U_kj) − κ w V_j, at least 0
//! k*   = argmin b_k + w V_k
//! ```
//!
//! U of roughened light needs confirmation: it is limited to U of a neighbouring pixel, or of the pixel's own batches
//! without the one that differs most.
//!
//! Rougher levels are not always less noisy, so the variances are not forced to decrease.
//!
//! The picture is the sum of two layers with separate choices (`layer.rs`). One is the light that all levels share,
//! sharp or blurred along the first surface without fireflies. The other is the light of roughened vertices at one of
//! the levels, sharp or blurred along the first rough surface (`guide.rs`). Light and noise that a blur takes across an
//! edge are weighted as at the darkest pixel around.
//!
//! A level without any hit looks free of noise. So V_k also includes the variance of light that level k has missed,
//! weighted by the chance of missing it (`coarse.rs`).
//!
//! A choice that few pixels around share is due to chance: such a pixel takes a wider blur (`layer::common`).
//!
//! A layer is Σ_k tent_1(1[k* = k]) of its candidates, times a smooth factor that restores the energy of the best level
//! at a coarse scale without visible structure. In a film of one level, light that was cut is first restored surface by
//! surface (`surfaces.rs`).
//!
//! To save memory, candidates are computed in tiles with the margins that filters reach (`tiles.rs`), and sizes of hits
//! and energies on cells of the whole picture.

mod coarse;
mod denoised;
mod filter;
mod guide;
mod layer;
mod statement;
mod surfaces;
#[cfg(test)]
mod tests;
mod tiles;

use crate::image::Buffer;
use crate::image::exr::Plane;
use crate::image::film::Window;
use crate::image::level_film::LevelFilm;
use crate::integrator::Picture;
use crate::math::{Rgb, Vec3A};
use crate::memory;
use coarse::{Caps, Coarse, FACTORS};
use guide::{Guide, Surface};
use rayon::prelude::*;
pub use tiles::Resolve;
use tiles::{Chosen, Limits, Shared, edge};

pub(crate) use denoised::denoise_film;
pub use statement::{Statement, error_of_less_noise};
pub(crate) use statement::{film_error, film_errors};

/// A picture whose level of roughening was chosen per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The picture.
    pub picture: Buffer,
    /// Chosen level of every pixel, sharp or blurred.
    pub level: Vec<u8>,
    /// Estimated squared bias of the chosen level, relative: over the squared picture + ε, mean of the channels.
    pub bias2: Vec<f32>,
    /// Estimated variance of the chosen level, relative in the same way.
    pub variance: Vec<f32>,
    /// Mean absolute noise of every pixel, summed over red, green and blue, in units of the picture.
    pub noise: Vec<f32>,
}

impl Resolved {
    /// Level 0 of a film, with an unknown error.
    fn unknown(film: &LevelFilm) -> Self {
        let picture = film.mean(0);
        let unknown = Self {
            level: vec![0; picture.pixels.len()],
            picture,
            bias2: Vec::new(),
            variance: Vec::new(),
            noise: Vec::new(),
        };
        unknown.of_unknown_error()
    }

    /// The same picture with an unknown error.
    fn of_unknown_error(self) -> Self {
        let pixels = self.level.len();
        Self {
            bias2: vec![0.0; pixels],
            variance: vec![f32::INFINITY; pixels],
            noise: vec![f32::INFINITY; pixels],
            ..self
        }
    }

    /// Error map: expected relative error of every pixel, estimated without a reference. Its mean is the average error
    /// of the [statement](Self::statement), up to effects at the border. Infinite if the error is unknown.
    pub fn error(&self) -> Vec<f32> {
        let pixels = &self.picture.pixels;
        if !self.is_known() {
            return vec![f32::INFINITY; pixels.len()];
        }
        if pixels.iter().all(|p| *p == Rgb::ZERO) {
            return vec![1.0; pixels.len()];
        }
        let errors = statement::errors_of_resolved(pixels, &self.noise);
        statement::smoothed(self.picture.size(), errors)
    }

    /// Expected squared relative error of every pixel, bias plus variance. Its mean is the squared root of the
    /// [statement](Self::statement).
    pub fn squares(&self) -> impl Iterator<Item = f32> {
        let pairs = self.bias2.iter().zip(&self.variance);
        pairs.map(|(b, v)| b + v)
    }

    /// True if the film had an estimate of its noise.
    pub fn is_known(&self) -> bool {
        self.variance.iter().all(|v| v.is_finite())
    }

    /// Channels for EXR files: `level`, and if the error is known `bias2` and `variance`.
    pub(crate) fn channels(&self) -> Vec<Plane<'_>> {
        let count = self.level.len();
        let level = Plane::new("level", "", count, |i| f32::from(self.level[i]));
        let mut channels = vec![level];
        if self.is_known() {
            channels.push(Plane::new("bias2", "", count, |i| self.bias2[i]));
            channels.push(Plane::new("variance", "", count, |i| self.variance[i]));
        }
        channels
    }

    /// Stated error of the picture, 1 if it is black.
    pub fn statement(&self) -> Statement {
        if !self.is_known() {
            return Statement::UNKNOWN;
        }
        if self.picture.pixels.iter().all(|p| *p == Rgb::ZERO) {
            return Statement::BLACK;
        }
        let squares = self.squares().map(f64::from);
        Statement::of_resolved(squares, &self.picture.pixels, &self.noise)
    }
}

/// Chooses a candidate for every pixel of a film. A film of one sample is split into two halves if blurs are allowed
/// and memory for another film is free. Otherwise, and if more than a hundredth of the pixels have no sample, the
/// picture is level 0. In both cases the error is unknown, and infinite.
pub fn resolve_film(film: &LevelFilm, settings: Resolve) -> Resolved {
    let choose = |film: &LevelFilm| {
        let limits = Limits::of(settings, film.levels());
        resolve(film, limits, edge(&film.window()))
    };
    match film.complete() {
        Some(complete) => {
            let mut resolved = choose(&complete);
            if settings == Resolve::None {
                resolved.picture = film.mean(0);
            }
            resolved
        }
        // Both halves have missed the same light, since they share one sample: no error is stated.
        None if settings == Resolve::Default && has_halves(film) => {
            choose(&halves(film)).of_unknown_error()
        }
        None => Resolved::unknown(film),
    }
}

/// True for a film of one sample with memory for its halves, which the memory estimate of a render does not include.
fn has_halves(film: &LevelFilm) -> bool {
    let pixels = film.window().len();
    let weights = (pixels * size_of::<[f32; 4]>()) as u64;
    let needed = LevelFilm::bytes(pixels, film.levels()) + 2 * weights;
    film.batches() == 1 && memory::check("halves of a sample", needed).is_ok()
}

/// Rows of a picture whose guides are computed at once.
const ROWS: u32 = 64;

/// The halves of a film of one sample. The weight of a neighbour is the product of its weights along both surfaces.
fn halves(film: &LevelFilm) -> LevelFilm {
    let window = film.window();
    let end = window.y + window.h;
    let weights = |first: u32| {
        // With a row on each side for edges and slopes.
        let y = first.saturating_sub(1).max(window.y);
        let h = (first + ROWS + 1).min(end) - y;
        let features = film.features_of(&Window { y, h, ..window });
        let size = (window.w as usize, h as usize);
        let guides = [Surface::First, Surface::Rough].map(|of| Guide::new(size, of, &features));
        let rows = (first - y) as usize..((first + ROWS).min(end) - y) as usize;
        let of = |pixel: usize| -> [f32; 4] {
            let [first, rough] = guides.each_ref().map(|guide| guide.beside(pixel));
            std::array::from_fn(|i| first[i] * rough[i])
        };
        let pixels = rows.start * size.0..rows.end * size.0;
        pixels.map(of).collect::<Vec<_>>()
    };
    let bands: Vec<u32> = (window.y..end).step_by(ROWS as usize).collect();
    let bands: Vec<_> = bands.into_par_iter().map(weights).collect();
    film.halves(&bands.concat())
}

/// Stated error of a picture with these settings: that of the choice if the picture has a film in batches and the
/// settings choose, else that of the noise of its samples.
pub fn stated_error(picture: &Picture, settings: Resolve) -> Statement {
    match &picture.levels {
        Some(film) if settings != Resolve::None => match film.batches() {
            0 | 1 => Statement::UNKNOWN,
            _ => resolve_film(film, settings).statement(),
        },
        _ => film_error(&picture.film),
    }
}

/// Error to compare with a target error: the stated error, raised where few bright samples dominate it.
pub fn stopping_error(picture: &Picture) -> f64 {
    stated_error(picture, Resolve::default()).bound()
}

/// [`stopping_error`] of a picture that is the mean of its samples, without a choice: the larger of the errors
/// estimated from samples and from batches.
pub(crate) fn stopping_error_of_samples(picture: &Picture) -> f64 {
    let of_batches = |film| resolve_film(film, Resolve::None).statement().mean;
    let shown = picture.levels.as_ref().map_or(0.0, of_batches);
    film_error(&picture.film).bound().max(shown)
}

/// Share of the light of a picture of several levels that plain path tracing cannot find: lights without area seen via
/// Dirac lobes. 0 for one level.
pub fn unseen_share(picture: &Picture) -> f64 {
    let sum = |pixels: &mut dyn Iterator<Item = Rgb>| -> f64 {
        pixels.map(|p| f64::from(p.element_sum())).sum()
    };
    let Some(film) = &picture.levels else {
        return 0.0;
    };
    let mut plain = picture.film.pixels.iter().map(|m| m.mean.as_vec3());
    let (all, plain) = (sum(&mut film.means(0)), sum(&mut plain));
    if all > 0.0 { 1.0 - plain / all } else { 0.0 }
}

/// Chooses in tiles with `edge` pixels a side; at least two batches must have samples.
fn resolve(film: &LevelFilm, limits: Limits, edge: u32) -> Resolved {
    // The layer whose fireflies are capped before blurs; roughened light of several levels has no caps.
    let blurred = |pixel, batch| match film.levels() {
        1 => only_light(film, pixel, batch),
        levels => film.batch_mean(pixel, batch, levels).into(),
    };
    let whole = Shared {
        film,
        roughened: Coarse::roughened(film),
        caps: Caps::of(film, blurred),
        shares: film.shares(),
        gain: gain(film.means(film.levels() - 1)),
        limits,
    };
    let Chosen {
        level,
        bias2,
        variance,
        mut noise,
        layers: [mut p, mut r],
    } = whole.choose(edge);
    // Light of fireflies was cut from the only level, and its batches decide how much of it to restore.
    let surfaces = match film.levels() {
        1 => surfaces::factors(film, &whole.roughened, &whole.caps, &r),
        _ => Vec::new(),
    };
    r.iter_mut().zip(&surfaces).for_each(|(r, f)| *r *= *f);
    let energies = [
        Coarse::shared(film).energy(|pixel| p[pixel].into()),
        whole.roughened.energy(|pixel| r[pixel].into()),
    ];
    for (pixel, (p, r)) in p.iter_mut().zip(&r).enumerate() {
        let [of_p, mut of_r] = energies.each_ref().map(|e| Rgb::from(e.at(pixel)));
        if let Some(own) = surfaces.get(pixel) {
            of_r = of_r.min(FACTORS[1] / *own);
        }
        let before = (*p + *r).element_sum();
        *p = *p * of_p + *r * of_r;
        if before > 0.0 {
            noise[pixel] *= p.element_sum() / before;
        }
    }
    let window = film.window();
    Resolved {
        picture: Buffer {
            width: window.w as usize,
            height: window.h as usize,
            pixels: p,
        },
        level,
        bias2,
        variance,
        noise,
    }
}

/// Light that blurs use, of a batch of a film of one level: without the shared light, at least 0.
fn only_light(film: &LevelFilm, pixel: usize, batch: usize) -> Vec3A {
    let all = film.batch_mean(pixel, batch, 0) - film.batch_mean(pixel, batch, 1);
    all.max(Rgb::ZERO).into()
}

/// The factor that makes the mean of a picture 0.3.
fn gain(picture: impl ExactSizeIterator<Item = Rgb>) -> f32 {
    let pixels = picture.len();
    let sum: f64 = picture.map(|p| f64::from(p.element_sum())).sum();
    let mean = sum / (3 * pixels).max(1) as f64;
    if mean > 0.0 { (0.3 / mean) as f32 } else { 1.0 }
}
