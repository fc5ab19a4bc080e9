//! A few roughened paths as a witness: they reveal light that a picture's integrator has missed.
//!
//! The noise of an estimator does not show light that it has missed. Roughened paths soon find the light of caustics
//! and of lamps behind glass, with nearly the right energy but not quite at the right place. A picture misses light if
//! it is darker than the witness's by more than both noises and the change by roughening, and if a part of it is darker
//! by more than chance makes the darkest of all parts. One bright sample is one standard error: twenty are needed.
//!
//! Its samples have separate random numbers that depend on seed and pixel only; their number depends on the picture's.
//! So its result is the same however the render was divided, and it changes no pixel.

use super::{advise, photons};
use crate::image::exr::Metadata;
use crate::image::film::{Film, Window};
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Amounts, Estimator, Picture, Settings, View};
use crate::math::UVec2;
use crate::math::moments::Moments;
use crate::regularise::Rule;
use crate::sampler::{Domain, SamplerKind, Seed};
use crate::scene::medium::Media;
use std::fmt;

/// Share of the render's time that a witness takes.
pub(super) const SHARE: f64 = 0.04;

/// Fewest samples of a witness over all pixels, and most samples per pixel.
const SAMPLES: (usize, u32) = (1 << 14, 64);

/// Factor that all paths are roughened by.
const GAMMA: f32 = 0.3;

/// Fewest samples of the witness in a tile; fewest pixels of a tile's side.
const TILE: (u32, u32) = (1024, 8);

/// Probability that chance alone raises one of the tiles of a picture above the bound.
const CHANCE: f64 = 1e-3;

/// Least missing share of the light: of the whole beyond noise, which roughening changes by less; and of a part.
pub(super) const MIN_SHARES: (f64, f64) = (0.01, 0.1);

/// Light that is missing in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingLight {
    /// Lower bound of the missing share of the light.
    pub share: f64,
    /// Pixel of the frame around which most light is missing.
    pub pixel: UVec2,
    /// The integrator that finds it; `path` stands for path tracing with levels.
    pub finder: IntegratorKind,
    /// Squared missing share of the light of every pixel of the window; 0 where nothing is missing.
    pub squares: Vec<f32>,
}

impl MissingLight {
    /// Expected errors of pixels with the missing light added, at most 1.
    pub(crate) fn beside(&self, mut errors: Vec<f32>) -> Vec<f32> {
        let pairs = errors.iter_mut().zip(&self.squares);
        pairs.for_each(|(error, square)| *error = (*error + square.sqrt()).min(1.0));
        errors
    }

    /// Adds the share to the metadata of a picture.
    pub(crate) fn note(&self, metadata: &mut Metadata) {
        metadata.insert("light_missing".into(), format!("{:.3}", self.share));
    }
}

impl fmt::Display for MissingLight {
    /// The share, the place, and an option that finds the light.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let UVec2 { x, y } = self.pixel;
        let percent = 100.0 * self.share;
        write!(
            out,
            "at least {percent:.0} % of the light is missing around {x},{y}; "
        )?;
        if self.finder.is_path() {
            write!(out, "--opsr-table beta-0.001 finds more of it")
        } else {
            write!(out, "--integrator {} finds it", self.finder)
        }
    }
}

/// Samples per pixel of a render's witness. 0 if there is none: for roughened paths and levels, the roughest of which
/// finds as much; for scenes without glossy lobes or with glossy media; and for short renders.
fn samples_beside(view: &View<'_>, settings: &Settings, samples: u32) -> u32 {
    let roughened = settings.rule != Rule::Plain;
    // Roughened phase functions change a picture's light.
    let uneven = (view.scene.media()).is_some_and(Media::has_lobes);
    if roughened || uneven || settings.strategy.is_some() || !view.scene.features().lobes {
        return 0;
    }
    let cost = settings.estimator.cost(1.0);
    let count = (SHARE * cost * f64::from(samples)).round();
    let count = (count as u32).min(SAMPLES.1);
    if view.window.len() * (count as usize) < SAMPLES.0 {
        return 0;
    }
    count
}

/// Comparison of a part of the witness's picture with the render's.
#[derive(Clone, Copy, Default)]
pub(super) struct Part {
    /// Sum of the witness's light, and of its excess over the picture.
    pub(super) light: f64,
    pub(super) excess: f64,
    /// Variance of the excess.
    pub(super) variance: f64,
}

impl Part {
    fn add(&mut self, other: &Self) {
        self.light += other.light;
        self.excess += other.excess;
        self.variance += other.variance;
    }

    /// Missing share of the light beyond two standard errors.
    pub(super) fn share(&self) -> f64 {
        (self.excess - 2.0 * self.variance.sqrt()) / self.light
    }

    /// True if light is missing by more than this number of standard errors and by the least share of a part.
    pub(super) fn is_dark(&self, bound: f64) -> bool {
        let errors = self.excess / self.variance.sqrt().max(f64::MIN_POSITIVE);
        errors > bound && self.excess > MIN_SHARES.1 * self.light
    }
}

/// A part of a grid and its neighbours, because roughening and merging spread light.
pub(super) fn around(i: usize, columns: usize, rows: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (i % columns, i / columns);
    let row = move |y| (x.saturating_sub(1)..(x + 2).min(columns)).map(move |x| y * columns + x);
    (y.saturating_sub(1)..(y + 2).min(rows)).flat_map(row)
}

/// Upper bound of the normal quantile that one of `parts` parts exceeds by chance with this probability.
pub(super) fn normal_bound(parts: usize, chance: f64) -> f64 {
    (2.0 * (parts as f64 / chance).ln()).sqrt()
}

/// Looks for light that a render of a view misses after this number of samples per pixel.
pub fn missing_light(
    view: &View<'_>,
    settings: &Settings,
    picture: &Picture,
    samples: u32,
) -> Option<MissingLight> {
    let count = samples_beside(view, settings, samples);
    if count == 0 {
        return photons::missing_light(view, settings, picture, samples);
    }
    let witness = Settings {
        estimator: Estimator::Path { reuse: false },
        rule: Rule::constant(GAMMA),
        amounts: Amounts::Raw,
        sampler: SamplerKind::Independent,
        seed: Seed(settings.seed).derive(Domain::Witness, 0).0,
        ..settings.clone()
    };
    let film = &picture.film;
    let mut shown = Picture::new(Film::cropped(film.size, film.window).ok()?);
    witness.integrator().pass(view, 0..count, &mut shown);
    let found = compared(&shown.film, film, count)?;
    let kind = advise(view.scene).kind;
    let finder = match kind.estimator(Default::default()) {
        advised
            if std::mem::discriminant(&advised) == std::mem::discriminant(&settings.estimator) =>
        {
            // The advised estimator is in use already, and needs a table or more time.
            IntegratorKind::Path
        }
        _ => kind,
    };
    Some(MissingLight { finder, ..found })
}

/// The light that a film misses, given a witness with this number of samples per pixel.
fn compared(witness: &Film, film: &Film, samples: u32) -> Option<MissingLight> {
    let window = film.window;
    let edge = (f64::from(TILE.0) / f64::from(samples)).sqrt().ceil() as u32;
    let edge = edge.max(TILE.1);
    let tiles = window.tiles(edge);
    let parts: Vec<Part> = tiles.iter().map(|tile| part(witness, film, tile)).collect();
    let mut whole = Part::default();
    parts.iter().for_each(|part| whole.add(part));
    let share = whole.share();
    if share.is_nan() || share < MIN_SHARES.0 {
        return None;
    }
    let columns = window.w.div_ceil(edge) as usize;
    let rows = tiles.len() / columns;
    let over = |i: usize| {
        let mut sum = Part::default();
        around(i, columns, rows).for_each(|i| sum.add(&parts[i]));
        sum
    };
    let bound = normal_bound(tiles.len(), CHANCE);
    let surroundings: Vec<Part> = (0..tiles.len()).map(over).collect();
    let dark = (0..tiles.len()).filter(|&i| surroundings[i].is_dark(bound));
    let darkest = dark.max_by(|&a, &b| parts[a].excess.total_cmp(&parts[b].excess))?;
    let tile = &tiles[darkest];
    let pixel = UVec2::new(tile.x + tile.w / 2, tile.y + tile.h / 2);
    let mut squares = vec![0.0; window.len()];
    for (tile, part) in tiles
        .iter()
        .zip(&surroundings)
        .filter(|(_, part)| part.is_dark(bound))
    {
        let square = (part.excess * part.excess - part.variance).max(0.0) / part.light.powi(2);
        super::window::inside(tile, &window).for_each(|i| squares[i] = square as f32);
    }
    Some(MissingLight {
        share,
        pixel,
        finder: IntegratorKind::Path,
        squares,
    })
}

/// Squared error of the sum of a pixel's channels, which are correlated as they share paths.
pub(super) fn squared_error(moments: &Moments) -> f64 {
    let variance = match moments.n {
        0 | 1 => moments.mean * moments.mean,
        _ => moments.variance_of_mean(),
    };
    let error = variance.max(Default::default()).powf(0.5).element_sum();
    error * error
}

/// Compares a tile of a witness with that of a film.
fn part(witness: &Film, film: &Film, tile: &Window) -> Part {
    let mut part = Part::default();
    for i in super::window::inside(tile, &film.window) {
        let (theirs, ours) = (&witness.pixels[i], &film.pixels[i]);
        part.light += theirs.mean.element_sum();
        part.excess += (theirs.mean - ours.mean).element_sum();
        part.variance += squared_error(theirs) + squared_error(ours);
    }
    part
}

#[cfg(test)]
mod tests;
