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
//! U includes roughened light only if it is confirmed: a neighbouring pixel shows as much, or the pixel's own batches do
//! without the one that differs most.
//!
//! Rougher levels are not always less noisy: the variances are taken as they are.
//!
//! The picture is the sum of two layers, each of which is chosen by itself (`layer.rs`): the light that all levels share,
//! as it is or blurred along the first surface without its fireflies, and the light of roughened vertices at one of the
//! levels, as it is or blurred along the first rough surface (`guide.rs`). What a blur takes across an edge, light or noise,
//! is weighted for the darkest of the pixels around.
//!
//! A level that has met nothing looks free of noise. So V_k also includes the variance of light that level k has missed,
//! weighted by the chance of missing it (`coarse.rs`).
//!
//! A choice that few pixels around share is a chance of four batches: such a pixel takes a wider blur (`layer::common`).
//!
//! A layer is Σ_k tent_1(1[k* = k]) of its candidates, brought to the energy of the best level at a coarse
//! scale by a smooth factor: the energy correction adds no visible structure. Light that was cut from the only level of a film
//! comes back surface by surface first (`surfaces.rs`).
//!
//! Candidates are chosen in tiles with as much around them as filters reach (`tiles.rs`), sizes of hits and energy are taken
//! on cells of whole pictures: a film takes little memory beside its own.

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
pub use statement::{Statement, error_of_less_noise, film_error, film_errors};

/// A picture whose level of roughening was chosen per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The picture.
    pub picture: Buffer,
    /// Chosen level of every pixel, sharp or blurred.
    pub level: Vec<u8>,
    /// Estimated squared bias of the chosen level, relative: over the squared picture + ε, mean of the channels.
    pub bias2: Vec<f32>,
    /// Estimated variance of the chosen level, relative likewise.
    pub variance: Vec<f32>,
    /// Mean absolute noise of every pixel, red, green and blue added up, in units of the picture.
    pub noise: Vec<f32>,
}

impl Resolved {
    /// Level 0 of a film, of whose error nothing is known.
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

    /// The same picture, of whose error nothing is known.
    fn of_unknown_error(self) -> Self {
        let pixels = self.level.len();
        Self {
            bias2: vec![0.0; pixels],
            variance: vec![f32::INFINITY; pixels],
            noise: vec![f32::INFINITY; pixels],
            ..self
        }
    }

    /// Error map: the relative error to be expected of every pixel, without a reference. Its mean is the average error of the
    /// [statement](Self::statement), to what the border adds. Infinite where nothing is known.
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

    /// Squared relative error to be expected of every pixel, bias and variance; their mean is the squared root of the
    /// [statement](Self::statement).
    pub fn squares(&self) -> impl Iterator<Item = f32> {
        let pairs = self.bias2.iter().zip(&self.variance);
        pairs.map(|(b, v)| b + v)
    }

    /// True if the film had an estimate of its noise.
    pub fn is_known(&self) -> bool {
        self.variance.iter().all(|v| v.is_finite())
    }

    /// Channels for EXR files: `level`; where a film had an estimate of its noise `bias2` and `variance` too.
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

/// Chooses for every pixel of a film. Where it may be blurred, a film of one sample is taken as two halves of its pixels, which need as much
/// memory as the film. Else, and where more than a hundredth of the pixels have no sample, its picture is level 0. In both cases the error is
/// unknown, and given as infinite.
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
        // Halves share all that their one sample has missed: their error is not stated.
        None if settings == Resolve::Default && has_halves(film) => {
            choose(&halves(film)).of_unknown_error()
        }
        None => Resolved::unknown(film),
    }
}

/// True for a film of one sample, if there is memory for its halves: estimates of a render's memory do not have them.
fn has_halves(film: &LevelFilm) -> bool {
    let pixels = film.window().len();
    let weights = (pixels * size_of::<[f32; 4]>()) as u64;
    let needed = LevelFilm::bytes(pixels, film.levels()) + 2 * weights;
    film.batches() == 1 && memory::check("halves of a sample", needed).is_ok()
}

/// Rows of a picture whose guides are there at once.
const ROWS: u32 = 64;

/// The halves of a film of one sample, of which a pixel takes light from beside it along both its surfaces.
fn halves(film: &LevelFilm) -> LevelFilm {
    let window = film.window();
    let end = window.y + window.h;
    let weights = |first: u32| {
        // With a row on each side, in which edges and slopes are looked for.
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

/// Stated error of a picture with these settings of the choice: that of the chosen level of every pixel if there are
/// several levels, else the noise of its film.
pub fn stated_error(picture: &Picture, settings: Resolve) -> Statement {
    match &picture.levels {
        Some(film) if settings != Resolve::None => match film.batches() {
            0 | 1 => Statement::UNKNOWN,
            _ => resolve_film(film, settings).statement(),
        },
        _ => film_error(&picture.film),
    }
}

/// Error that a picture is stopped at: the stated one, and more where few bright samples decide it.
pub fn stopping_error(picture: &Picture) -> f64 {
    stated_error(picture, Resolve::default()).bound()
}

/// The same of a picture that is shown without a choice, as the mean of its samples: the larger one of the errors that its samples
/// and its batches state.
pub(crate) fn stopping_error_of_samples(picture: &Picture) -> f64 {
    let of_batches = |film| resolve_film(film, Resolve::None).statement().mean;
    let shown = picture.levels.as_ref().map_or(0.0, of_batches);
    film_error(&picture.film).bound().max(shown)
}

/// Share of the light of a picture of several levels that plain path tracing cannot find: that of lights without area at
/// the end of Dirac lobes. 0 for one level.
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

/// Chooses in tiles with `edge` pixels a side; at least two batches have a sample.
fn resolve(film: &LevelFilm, limits: Limits, edge: u32) -> Resolved {
    // The layer that is blurred with all its fireflies: where there are several levels others know those of the second one.
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
    // Fireflies are cut from the only level, and its batches alone tell light from chance.
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

/// Light of a batch of a film of one level that its blurs take.
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
