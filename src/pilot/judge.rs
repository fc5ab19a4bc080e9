//! Small pictures of several integrators, judged without a reference.
//!
//! A pilot sees a few samples of a small picture. Light that comes as rare bright samples decides the error of the render, and
//! is met by chance in so few: what the scene's lights and materials call for is a better guess than a difference in noise. So the
//! contender that the scene calls for is taken unless another one is clearly better. Rules, each with a constant:
//!
//! - *Tiles*: the variance of a tile, relative to what the contenders together show there, over the samples that fit into the
//!   time of the render. A tile counts at most as one that is black, and tiles by the root of their error, so that no bright sample
//!   decides.
//! - *Missing light*: a tile that is darker than another contender shows it, by more than the noise of both, misses light. Light
//!   that none of n samples found has a second moment of at least n times its squared mean.
//! - *Parts*: the strategies of `path` are among those of `bdpt`, and its are among those of `vcm`, so that a sample of fewer
//!   strategies has no less variance `[Veach97 §9.2]`.
//! - *Doubt*: another contender needs less than a third of the error of the one that the scene calls for. A contender
//!   with levels replaces only `path`: its samples give no evidence of light that they have not found.

use super::{Contender, MISSED, Trial};
use crate::image::Buffer;
use crate::image::film::Window;
use crate::image::relative::EPSILON;
use crate::integrator::Picture;
use crate::integrator::method::{Blind, IntegratorKind};
use crate::math::Rgb;
use crate::regularise::Rule;
use crate::resolve::{Resolve, resolve_film};

/// Edge in pixels of the tiles.
const TILE: u32 = 8;

/// Standard errors by which a tile must be darker than with another contender to miss light.
const DARKER: f64 = 2.0;

/// Times that the error of another contender must be below that of the one that the scene calls for. Of 1, 1.5, 2, 3 and 5 on
/// 20 scenes 3 and 5 chose best; 5 is more than what samples of `vcm` and `path` differ in cost.
const MARGIN: f64 = 3.0;

/// Exponent with which the squared error of levels falls as samples grow: less noise, and less roughening.
const LEVELS_FALL: f64 = 0.8;

/// A contender's small picture.
pub(super) struct Draft {
    kind: IntegratorKind,
    /// False if the picture is regularised: less variance for some bias.
    plain: bool,
    /// True if every pixel has the best of several levels.
    levels: bool,
    /// Samples per pixel.
    samples: f64,
    /// Time of a sample per pixel.
    cost: f64,
    /// Mean of every pixel and variance of one of its samples, the channels taken together.
    mean: Vec<f64>,
    variance: Vec<f64>,
}

impl Draft {
    /// The picture of a contender after this number of samples per pixel, each of this cost.
    pub(super) fn of(contender: &Contender, picture: &Picture, samples: u32, cost: f64) -> Self {
        let grey = |buffer: &Buffer| {
            let each = |p: &Rgb| p.as_dvec3().element_sum() / 3.0;
            buffer.pixels.iter().map(each).collect::<Vec<f64>>()
        };
        let (mean, variance) = match &picture.levels {
            Some(levels) if contender.has_levels() => {
                let resolved = resolve_film(levels, Resolve::default());
                let absolute = |(m, square): (&Rgb, f32)| {
                    let squared = m.as_dvec3().length_squared() / 3.0 + EPSILON;
                    f64::from(samples) * f64::from(square) * squared
                };
                let pixels = resolved.picture.pixels.iter().zip(resolved.squares());
                let variance = pixels.map(absolute).collect();
                (grey(&resolved.picture), variance)
            }
            _ => {
                let film = &picture.film;
                (grey(&film.mean()), grey(&film.sample_variance()))
            }
        };
        Self {
            kind: contender.kind,
            plain: contender.settings.rule == Rule::Plain,
            levels: contender.has_levels(),
            samples: samples.into(),
            cost,
            mean,
            variance,
        }
    }

    /// Light paths alone never find what is seen by way of a Dirac lobe, others no light without area there; what is roughened
    /// does.
    fn is_blind(&self, punctual: bool) -> bool {
        match self.kind.row().blind {
            Blind::ToMirrors => true,
            Blind::ToPoints => punctual && self.plain,
            Blind::Never => false,
        }
    }

    /// Mean of some pixels, and the variance of that mean; of so few samples it is often zero by chance, so that a sample of
    /// a pixel counts as having no less than `usual`.
    fn tile(&self, pixels: &[usize], usual: &[f64]) -> (f64, f64) {
        let count = pixels.len() as f64;
        let mean: f64 = pixels.iter().map(|&p| self.mean[p]).sum();
        let variance: f64 = (pixels.iter())
            .map(|&p| self.variance[p].max(usual[p]))
            .sum();
        (mean / count, variance / (count * count * self.samples))
    }

    /// Samples per pixel in so much time per pixel.
    fn samples_in(&self, time: f64) -> f64 {
        (time / self.cost).max(1.0)
    }

    /// Number of samples by which the variance of one is divided.
    fn divisor(&self, samples: f64) -> f64 {
        match self.kind {
            // The radius of merges shrinks, so that the variance of a sample rises with n^(1 − α).
            IntegratorKind::Sppm => samples / (samples / self.samples).max(1.0).cbrt(),
            _ if self.levels => self.samples * (samples / self.samples).powf(LEVELS_FALL),
            _ => samples,
        }
    }
}

/// Median of some contenders in every pixel: a bright sample of one of them does not change it.
fn median(drafts: &[&Draft], values: impl Fn(&Draft) -> &[f64]) -> Vec<f64> {
    let pixels = drafts.first().map_or(0, |draft| draft.mean.len());
    let of_pixel = |pixel: usize| {
        let mut sorted: Vec<f64> = drafts.iter().map(|d| values(d)[pixel]).collect();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = ((sorted.len() - 1) / 2, sorted.len() / 2);
        0.5 * (sorted[low] + sorted[high])
    };
    (0..pixels).map(of_pixel).collect()
}

/// Radiance of every pixel, from the contenders that find all light.
fn radiance(drafts: &[Draft], punctual: bool) -> Vec<f64> {
    let mut seeing: Vec<&Draft> = drafts.iter().filter(|d| !d.is_blind(punctual)).collect();
    if seeing.is_empty() {
        seeing = drafts.iter().collect();
    }
    median(&seeing, |d| &d.mean)
}

/// Light of a tile that a draft lacks and another one shows.
struct Lack {
    /// Its square, without what noise adds.
    squared: f64,
    /// Light beyond noise.
    beyond: f64,
}

impl Lack {
    /// Compares a tile's mean and variance with those of the others.
    fn of((mean, variance): (f64, f64), others: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut squared, mut beyond) = (0.0f64, 0.0f64);
        for (other, other_variance) in others {
            let (noise, lack) = (variance + other_variance, other - mean);
            let significant = lack - DARKER * noise.sqrt();
            if significant > 0.0 {
                squared = squared.max(lack * lack - noise);
                beyond = beyond.max(significant);
            }
        }
        Self { squared, beyond }
    }
}

/// The contenders' small pictures of a window against each other, for a render of this time per pixel; `punctual` if there
/// are lights without area.
pub(super) fn judged(drafts: &[Draft], window: Window, time: f64, punctual: bool) -> Vec<Trial> {
    let radiance = radiance(drafts, punctual);
    let usual = median(&drafts.iter().collect::<Vec<_>>(), |d| &d.variance);
    let tiles: Vec<Vec<usize>> = (window.tiles(TILE).iter())
        .map(|tile| super::window::inside(tile, &window).collect())
        .collect();
    let mean = |pixels: &[usize], values: &[f64]| {
        pixels.iter().map(|&p| values[p]).sum::<f64>() / pixels.len().max(1) as f64
    };
    let count = tiles.len().max(1) as f64;
    let mut light = 0.0f64;
    let mut dark = vec![0.0; drafts.len()];
    let mut roots = vec![0.0; drafts.len()];
    let mut whole = vec![0.0; drafts.len()];
    for pixels in &tiles {
        let shown = mean(pixels, &radiance);
        let means: Vec<(f64, f64)> = drafts.iter().map(|d| d.tile(pixels, &usual)).collect();
        let variances: Vec<f64> = (drafts.iter().enumerate())
            .map(|(i, draft)| {
                let lack = Lack::of(means[i], means.iter().copied());
                let (samples, blind) = (draft.samples_in(time), draft.is_blind(punctual));
                let found = draft.samples * pixels.len() as f64;
                dark[i] += if blind { lack.beyond / count } else { 0.0 };
                let least = lack.squared * if blind { samples } else { samples.min(found) };
                mean(pixels, &draft.variance).max(least)
            })
            .collect();
        for (i, draft) in drafts.iter().enumerate() {
            let more =
                |&j: &usize| draft.plain && draft.kind.row().part_of.contains(&drafts[j].kind);
            let variance = ((0..drafts.len()).filter(more))
                .map(|j| variances[j])
                .fold(variances[i], f64::max);
            let samples = draft.divisor(draft.samples_in(time));
            let squared = variance / (shown * shown + EPSILON) / samples;
            roots[i] += squared.min(1.0).sqrt() / count;
            whole[i] += means[i].0 / count;
            light = light.max(whole[i]);
        }
    }
    let trial = |(i, draft): (usize, &Draft)| Trial {
        kind: draft.kind,
        levels: draft.levels,
        samples: draft.samples_in(time),
        error: roots[i],
        missed: dark[i] / light.max(1e-30),
    };
    drafts.iter().enumerate().map(trial).collect()
}

/// The place of the trial to take, where the scene calls for the one at place `first`: that one, unless it misses light or
/// another is clearly better; if all miss light, the one that misses least.
pub(super) fn best(trials: &[Trial], first: usize) -> Option<usize> {
    let sees = |i: &usize| trials[*i].missed < MISSED;
    let order = |a: &usize, b: &usize| trials[*a].error.total_cmp(&trials[*b].error);
    let seeing = || (0..trials.len()).filter(sees);
    let called = trials.get(first)?;
    if !sees(&first) {
        let missed = |a: &usize, b: &usize| trials[*a].missed.total_cmp(&trials[*b].missed);
        return seeing()
            .min_by(order)
            .or_else(|| (0..trials.len()).min_by(missed));
    }
    let clearly = |i: &usize| {
        let known = !trials[*i].levels || called.kind == IntegratorKind::Path;
        known && trials[*i].error * MARGIN.sqrt() < called.error
    };
    seeing().filter(clearly).min_by(order).or(Some(first))
}

#[cfg(test)]
mod tests;
