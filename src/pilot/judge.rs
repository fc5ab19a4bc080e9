//! Small pictures of several integrators, judged without a reference.
//!
//! A pilot has few samples of a small picture. Rare bright samples decide a render's error, and few samples contain
//! them only by chance. Lights and materials are therefore a better guide than a difference in noise: the contender
//! advised for them is taken unless another is clearly better. Rules, each with a constant:
//!
//! - *Tiles*: the mean variance of a tile's pixels over their squared radiance, which is the median of the contenders,
//!   divided by the samples that fit into the render's time. A tile counts at most as much as a black one, and errors
//!   are averaged by their roots, so that no single bright sample decides.
//! - *Missing light*: a tile misses light if it is darker than another contender's by more than the noise of both.
//!   Light that none of n samples found has a second moment of at least n times its squared mean.
//! - *Parts*: the strategies of `path` are a subset of those of `bdpt`, and these of those of `vcm`. So a sample of
//!   fewer strategies has no less variance `[Veach97 §9.2]`.
//! - *Doubt*: another contender replaces the advised one only if it has less than a third of the squared error. A
//!   contender with levels replaces only `path`: its samples are no evidence of light that they have not found.

use super::{Contender, MISSED, Trial};
use crate::image::Buffer;
use crate::image::film::Window;
use crate::image::relative::EPSILON;
use crate::integrator::Picture;
use crate::integrator::method::{IntegratorKind, Misses};
use crate::math::Rgb;
use crate::regularise::Rule;
use crate::resolve::{Resolve, resolve_film};

/// Edge in pixels of the tiles.
const TILE: u32 = 8;

/// Number of standard errors by which a tile that misses light must be darker than another contender's.
const DARKER: f64 = 2.0;

/// Factor by which another contender's squared error must be smaller than the advised one's. Of 1, 1.5, 2, 3 and 5, the
/// values 3 and 5 chose best on 20 scenes; 5 exceeds the ratio of the costs of samples of `vcm` and `path`.
const MARGIN: f64 = 3.0;

/// Exponent of the number of samples in the decrease of levels' squared error: both noise and roughening decrease.
const LEVELS_FALL: f64 = 0.8;

/// A contender's small picture.
pub(super) struct PilotPicture {
    kind: IntegratorKind,
    /// False if the picture is regularised: less variance for some bias.
    plain: bool,
    /// True if every pixel has the best of several levels.
    levels: bool,
    /// Samples per pixel.
    samples: f64,
    /// Cost of a sample per pixel in camera paths.
    cost: f64,
    /// Mean of every pixel and variance of one of its samples, both averaged over channels.
    mean: Vec<f64>,
    variance: Vec<f64>,
}

impl PilotPicture {
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

    /// True if the contender can never find some light: light tracing finds nothing seen via a Dirac lobe, and others
    /// find no lights without area there unless they roughen.
    fn is_blind(&self, punctual: bool) -> bool {
        match self.kind.row().misses {
            Misses::AllByDirac => true,
            Misses::PointsByDirac => punctual && self.plain,
            Misses::Nothing => false,
        }
    }

    /// Mean of some pixels, and its variance. The estimated variance of few samples is often zero by chance, so the
    /// variance of a sample counts as at least `usual`.
    fn tile(&self, pixels: &[usize], usual: &[f64]) -> (f64, f64) {
        let count = pixels.len() as f64;
        let mean: f64 = pixels.iter().map(|&p| self.mean[p]).sum();
        let variance: f64 = (pixels.iter())
            .map(|&p| self.variance[p].max(usual[p]))
            .sum();
        (mean / count, variance / (count * count * self.samples))
    }

    /// Samples per pixel in `time` camera paths per pixel.
    fn samples_in(&self, time: f64) -> f64 {
        (time / self.cost).max(1.0)
    }

    /// Effective number of samples by which the variance of one is divided.
    fn divisor(&self, samples: f64) -> f64 {
        match self.kind {
            // The radius of merges shrinks, so that the variance of a sample rises with n^(1 − α).
            IntegratorKind::Sppm => samples / (samples / self.samples).max(1.0).cbrt(),
            _ if self.levels => self.samples * (samples / self.samples).powf(LEVELS_FALL),
            _ => samples,
        }
    }
}

/// Median over some contenders in every pixel, so that a bright sample of one contender makes no difference.
fn median(pilots: &[&PilotPicture], values: impl Fn(&PilotPicture) -> &[f64]) -> Vec<f64> {
    let pixels = pilots.first().map_or(0, |pilot| pilot.mean.len());
    let of_pixel = |pixel: usize| {
        let mut sorted: Vec<f64> = pilots.iter().map(|d| values(d)[pixel]).collect();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = ((sorted.len() - 1) / 2, sorted.len() / 2);
        0.5 * (sorted[low] + sorted[high])
    };
    (0..pixels).map(of_pixel).collect()
}

/// Radiance of every pixel, by the contenders that can find all light, or by all if there are none.
fn radiance(pilots: &[PilotPicture], punctual: bool) -> Vec<f64> {
    let mut seeing: Vec<&PilotPicture> = pilots.iter().filter(|d| !d.is_blind(punctual)).collect();
    if seeing.is_empty() {
        seeing = pilots.iter().collect();
    }
    median(&seeing, |d| &d.mean)
}

/// Light of a tile that is in another pilot picture and not in this one.
struct TileDeficit {
    /// Square of the missing light, minus the variance of the difference.
    squared: f64,
    /// Missing light beyond [`DARKER`] standard errors.
    beyond: f64,
}

impl TileDeficit {
    /// Compares a tile's mean and variance with those of the others.
    fn of((mean, variance): (f64, f64), others: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut squared, mut beyond) = (0.0f64, 0.0f64);
        for (other, other_variance) in others {
            let (noise, deficit) = (variance + other_variance, other - mean);
            let significant = deficit - DARKER * noise.sqrt();
            if significant > 0.0 {
                squared = squared.max(deficit * deficit - noise);
                beyond = beyond.max(significant);
            }
        }
        Self { squared, beyond }
    }
}

/// Judges the contenders' small pictures of a window, for a render of `time` camera paths per pixel. `punctual` is true
/// if there are lights without area.
pub(super) fn judged(
    pilots: &[PilotPicture],
    window: Window,
    time: f64,
    punctual: bool,
) -> Vec<Trial> {
    let radiance = radiance(pilots, punctual);
    let usual = median(&pilots.iter().collect::<Vec<_>>(), |d| &d.variance);
    let tiles: Vec<Vec<usize>> = (window.tiles(TILE).iter())
        .map(|tile| super::window::inside(tile, &window).collect())
        .collect();
    let mean = |pixels: &[usize], values: &[f64]| {
        pixels.iter().map(|&p| values[p]).sum::<f64>() / pixels.len().max(1) as f64
    };
    let count = tiles.len().max(1) as f64;
    let mut light = 0.0f64;
    let [mut dark, mut roots, mut whole] = [0; 3].map(|_| vec![0.0; pilots.len()]);
    for pixels in &tiles {
        let shown = mean(pixels, &radiance);
        let means: Vec<(f64, f64)> = pilots.iter().map(|d| d.tile(pixels, &usual)).collect();
        let variances: Vec<f64> = (pilots.iter().enumerate())
            .map(|(i, pilot)| {
                let deficit = TileDeficit::of(means[i], means.iter().copied());
                let (samples, blind) = (pilot.samples_in(time), pilot.is_blind(punctual));
                let found = pilot.samples * pixels.len() as f64;
                dark[i] += if blind { deficit.beyond / count } else { 0.0 };
                let least = deficit.squared * if blind { samples } else { samples.min(found) };
                mean(pixels, &pilot.variance).max(least)
            })
            .collect();
        for (i, pilot) in pilots.iter().enumerate() {
            let more =
                |&j: &usize| pilot.plain && pilot.kind.row().part_of.contains(&pilots[j].kind);
            let variance = ((0..pilots.len()).filter(more))
                .map(|j| variances[j])
                .fold(variances[i], f64::max);
            let samples = pilot.divisor(pilot.samples_in(time));
            let squared = variance / (shown * shown + EPSILON) / samples;
            roots[i] += squared.min(1.0).sqrt() / count;
            whole[i] += means[i].0 / count;
            light = light.max(whole[i]);
        }
    }
    let trial = |(i, pilot): (usize, &PilotPicture)| Trial {
        kind: pilot.kind,
        levels: pilot.levels,
        samples: pilot.samples_in(time),
        error: roots[i],
        missed: dark[i] / light.max(1e-30),
    };
    pilots.iter().enumerate().map(trial).collect()
}

/// Index of the trial to take: `first`, the advised one, unless it misses light or another is clearly better. If all
/// miss light, the one that misses least.
pub(super) fn best(trials: &[Trial], first: usize) -> Option<usize> {
    let sees = |i: &usize| trials[*i].missed < MISSED;
    let order = |a: &usize, b: &usize| trials[*a].error.total_cmp(&trials[*b].error);
    let seeing = || (0..trials.len()).filter(sees);
    let advised = trials.get(first)?;
    if !sees(&first) {
        let missed = |a: &usize, b: &usize| trials[*a].missed.total_cmp(&trials[*b].missed);
        return seeing()
            .min_by(order)
            .or_else(|| (0..trials.len()).min_by(missed));
    }
    let clearly = |i: &usize| {
        let known = !trials[*i].levels || advised.kind == IntegratorKind::Path;
        known && trials[*i].error * MARGIN.sqrt() < advised.error
    };
    seeing().filter(clearly).min_by(order).or(Some(first))
}

#[cfg(test)]
mod tests;
