//! Scale and contrast of a table for a scene, chosen by a pilot without a reference.
//!
//! The blur that a scene tolerates is not part of a path's class. A table therefore serves scenes unlike its training
//! scenes only at a scale of their own, and where a scene is unlike all of them, one factor for all paths is better
//! than the table's pattern.
//!
//! The pilot renders the scene at low resolution with the plain path tracer and with every candidate, a pair of scale
//! and contrast ([`TableTuning`]), *on the same paths*. The difference of two such pictures has hardly any noise but
//! that of the roughened connections. Its square over tiles, made unbiased by products of independent batches,
//! estimates bias²; the film gives the variance. The candidate with the least bias² + variance / N wins, so a render
//! of more samples N is roughened less.
//!
//! Paths are spent by two rounds of successive halving: all candidates trace a quarter of the paths, the best few of
//! them the rest.

mod candidate;

use crate::image::film::{Film, FilmError};
use crate::integrator::{Estimator, Picture, Settings, View};
use crate::pilot::window::pilot_window;
use crate::regularise::{Rule, TableTuning};
use crate::sampler::{Domain, SamplerKind, Seed};
use candidate::{BATCHES, CandidatePictures, Tiles};
use std::time::{Duration, Instant};

/// Contrasts of the candidates: all of the table's pattern, half of it, and none.
pub const CONTRASTS: [f32; 3] = [1.0, 0.5, 0.0];

/// Scales of the candidates, for each contrast.
pub const SCALES: [f32; 9] = [
    1.0 / 32.0,
    1.0 / 16.0,
    1.0 / 8.0,
    1.0 / 4.0,
    1.0 / 2.0,
    1.0,
    2.0,
    4.0,
    8.0,
];

/// The first round traces one in so many of the paths.
const FIRST_ROUND: u32 = 4;

/// Candidates of the second round, beside the untuned table.
const SECOND_ROUND: usize = 6;

/// Pixels of the pilot's pictures, about.
const PIXELS: f32 = 4096.0;

/// Paths of one candidate for each sample of the final render: few samples need only a rough choice.
const PATHS_PER_SAMPLE: u64 = 2500;

/// Fewest and most paths of one candidate.
const PATHS: (u64, u64) = (100_000, 1_000_000);

/// ε of the relative errors, where the mean of the picture counts as 0.3.
const EPSILON: f64 = 0.01;

/// Tunings of all candidates, contrast by contrast.
fn tunings() -> impl Iterator<Item = TableTuning> {
    let scales = |contrast| SCALES.map(|scale| TableTuning { scale, contrast });
    CONTRASTS.into_iter().flat_map(scales)
}

/// A tuning and its estimated error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Scale and contrast.
    pub tuning: TableTuning,
    /// Relative bias², an unbiased estimate: below 0 by chance.
    pub bias2: f64,
    /// Relative variance of one sample over the number of samples of the render.
    pub variance: f64,
    /// Relative change of the picture's mean.
    pub energy: f64,
}

impl Candidate {
    /// Bias² and variance together.
    pub fn error(&self) -> f64 {
        self.bias2.max(0.0) + self.variance
    }
}

/// Outcome of a pilot.
#[derive(Clone, Debug, PartialEq)]
pub struct Pilot {
    /// Tuning of the best candidate; [`TableTuning::NONE`] where the pilot cannot tell.
    pub tuning: TableTuning,
    /// True if a candidate was found better than the untuned table by more than the pilot's own noise.
    pub decided: bool,
    /// The candidates, contrast by contrast: measured from all paths in the second round, else from the first.
    pub candidates: Vec<Candidate>,
    /// Number of paths traced.
    pub paths: u64,
}

impl Pilot {
    /// Outcome where there is nothing to choose.
    const NONE: Self = Self {
        tuning: TableTuning::NONE,
        decided: false,
        candidates: Vec::new(),
        paths: 0,
    };

    /// Tuning of the best candidate that changes the mean of the picture by at most this share; of the one that changes
    /// it least if all change it by more.
    ///
    /// Errors of pixels alone favour pictures that are smooth and dark: where all light comes through glass, the best
    /// constant gives up a fifth of it.
    pub fn within(&self, share: f64) -> TableTuning {
        let excess = |c: &Candidate| (c.energy.abs() - share).max(0.0);
        let order = |a: &&Candidate, b: &&Candidate| {
            let errors = a.error().total_cmp(&b.error());
            excess(a).total_cmp(&excess(b)).then(errors)
        };
        let best = self.candidates.iter().min_by(order);
        best.map_or(TableTuning::NONE, |c| c.tuning)
    }
}

/// Chooses the tuning of the table in `settings` for a render of a view with `samples` samples per pixel.
///
/// Settings without a table, and scenes without lobes to roughen, need no pilot. The reuse mode is piloted in the
/// default mode, since its paths would differ between candidates. Fails where the window leaves the frame.
pub fn choose(settings: &Settings, view: &View<'_>, samples: u32) -> Result<Pilot, FilmError> {
    Ok(choose_while(settings, view, samples, &|| true)?.unwrap_or(Pilot::NONE))
}

/// Samples per pixel that a pilot assumes for a render to a target error.
pub const SPP_OF_TARGET: u32 = 256;

/// Samples per pixel that fit into this time, about. Fails where the window leaves the frame.
pub fn samples_in(time: Duration, settings: &Settings, view: &View<'_>) -> Result<u32, FilmError> {
    const PROBE: u32 = 4;
    let mut picture = Picture::new(Film::cropped(view.sensor.frame, view.window)?);
    let clock = Instant::now();
    (settings.integrator()).pass(view, 0..PROBE, &mut picture);
    let rate = f64::from(PROBE) / clock.elapsed().as_secs_f64().max(1e-6);
    Ok(((rate * time.as_secs_f64()) as u32).max(1))
}

/// [`choose`], given up with `None` when `go_on` says no; it is asked before every small render.
pub fn choose_while(
    settings: &Settings,
    view: &View<'_>,
    samples: u32,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<Pilot>, FilmError> {
    let Some(table) = settings.rule.table().filter(|_| view.scene.has_lobes()) else {
        return Ok(Some(Pilot::NONE));
    };
    let (frame, window) = pilot_window(view.sensor.frame, view.window, PIXELS);
    let view = View::new(view.scene, view.sensor.camera, frame, window);
    let (pixels, batches) = (window.len() as u64, BATCHES as u64);
    let wanted = (PATHS_PER_SAMPLE * u64::from(samples)).clamp(PATHS.0, PATHS.1);
    let spp = (wanted / (batches * pixels)).max(2) as u32;
    let first = 0..(spp / FIRST_ROUND).max(2);
    let second = first.end..spp;
    let begin = |rule: Rule| {
        if !go_on() {
            return Ok(None);
        }
        let settings = Settings {
            estimator: Estimator::Path { reuse: false },
            rule,
            // A picture that shares paths with its pilot would favour what these paths favour.
            seed: Seed(settings.seed).derive(Domain::Pilot, 0).0,
            // Batches are runs of sample numbers.
            sampler: SamplerKind::Independent,
            ..settings.clone()
        };
        let mut pictures = CandidatePictures::new(&settings, &view)?;
        pictures.trace(&view, spp, first.clone());
        Ok(Some(pictures))
    };
    let Some(mut plain) = begin(Rule::Plain)? else {
        return Ok(None);
    };
    let begun = tunings()
        .map(|tuning| begin(Rule::with_table(table.tuned(tuning))))
        .collect::<Result<Option<Vec<CandidatePictures>>, FilmError>>()?;
    let Some(mut pictures) = begun else {
        return Ok(None);
    };
    let tiles: Vec<(TableTuning, Tiles)> = tunings()
        .zip(&pictures)
        .map(|(tuning, pictures)| (tuning, pictures.tiles(window)))
        .collect();
    // Of the candidates with the whole pattern the roughest has the least noise.
    let weights = weights(&tiles[SCALES.len() - 1].1);
    let all: Vec<usize> = (0..BATCHES).collect();
    let measured = |plain: &Tiles, tiles: &[(TableTuning, Tiles)]| -> Vec<Candidate> {
        (tiles.iter())
            .map(|tiles| measure(plain, tiles, &weights, samples, &all))
            .collect()
    };
    let mut candidates = measured(&plain.tiles(window), &tiles);

    let best = survivors(&candidates);
    plain.trace(&view, spp, second.clone());
    let mut tiles = Vec::new();
    for &i in &best {
        if !go_on() {
            return Ok(None);
        }
        pictures[i].trace(&view, spp, second.clone());
        tiles.push((candidates[i].tuning, pictures[i].tiles(window)));
    }
    let plain = plain.tiles(window);
    for (&i, candidate) in best.iter().zip(measured(&plain, &tiles)) {
        candidates[i] = candidate;
    }
    let (tuning, decided) = decide(&plain, &tiles, &weights, samples);
    let passes = first.len() * (pictures.len() + 1) + second.len() * (best.len() + 1);
    Ok(Some(Pilot {
        tuning,
        decided,
        candidates,
        paths: passes as u64 * batches * pixels,
    }))
}

/// Indices of the candidates of the second round, ascending: the best ones, and the untuned table.
fn survivors(candidates: &[Candidate]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| candidates[a].error().total_cmp(&candidates[b].error()));
    let best = &order[..SECOND_ROUND.min(order.len())];
    (0..candidates.len())
        .filter(|i| best.contains(i) || candidates[*i].tuning == TableTuning::NONE)
        .collect()
}

/// 1 / (radiance² + ε) of every tile, at a brightness of 0.3.
fn weights(tiles: &Tiles) -> Vec<f64> {
    let count = tiles.variance.len();
    let mean = |t: usize| -> f64 {
        let sum: f64 = tiles.means.iter().map(|m| m[t].iter().sum::<f64>()).sum();
        sum / (3 * BATCHES) as f64
    };
    let whole = (0..count).map(mean).sum::<f64>() / count.max(1) as f64;
    let gain = 0.3 / whole.max(1e-30);
    (0..count)
        .map(|t| gain * gain / ((gain * mean(t)).powi(2) + EPSILON))
        .collect()
}

/// Error of a candidate from some of the batches.
fn measure(
    plain: &Tiles,
    (tuning, tiles): &(TableTuning, Tiles),
    weights: &[f64],
    samples: u32,
    batches: &[usize],
) -> Candidate {
    let pairs = (batches.len() * (batches.len() - 1)) as f64;
    let (mut bias2, mut variance) = (0.0, 0.0);
    let (mut difference, mut mean) = (0.0, 0.0);
    for (t, weight) in weights.iter().enumerate() {
        for c in 0..3 {
            let (mut sum, mut squares) = (0.0, 0.0);
            for &b in batches {
                let d = tiles.means[b][t][c] - plain.means[b][t][c];
                sum += d;
                squares += d * d;
                mean += plain.means[b][t][c];
            }
            difference += sum;
            // Σ over pairs of batches of the product of their differences.
            bias2 += weight * (sum * sum - squares) / pairs / 3.0;
        }
        variance += weight * tiles.variance[t] / f64::from(samples.max(1));
    }
    let count = weights.len().max(1) as f64;
    Candidate {
        tuning: *tuning,
        bias2: bias2 / count,
        variance: variance / count,
        energy: difference / mean.max(1e-30),
    }
}

/// The best candidate, if it beats the untuned table by more than the jackknife's standard error of the difference.
fn decide(
    plain: &Tiles,
    candidates: &[(TableTuning, Tiles)],
    weights: &[f64],
    samples: u32,
) -> (TableTuning, bool) {
    let errors = |batches: &[usize]| -> Vec<f64> {
        (candidates.iter())
            .map(|tiles| measure(plain, tiles, weights, samples, batches).error())
            .collect()
    };
    let all: Vec<usize> = (0..BATCHES).collect();
    let untuned = (candidates.iter())
        .position(|c| c.0 == TableTuning::NONE)
        .unwrap_or(0);
    let whole = errors(&all);
    let best = (0..whole.len())
        .min_by(|&a, &b| whole[a].total_cmp(&whole[b]))
        .unwrap_or(untuned);
    let gains: Vec<f64> = (0..BATCHES)
        .map(|left_out| {
            let batches: Vec<usize> = (0..BATCHES).filter(|&b| b != left_out).collect();
            let errors = errors(&batches);
            errors[untuned] - errors[best]
        })
        .collect();
    let n = BATCHES as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let spread: f64 = gains.iter().map(|g| (g - mean).powi(2)).sum();
    let error = ((n - 1.0) / n * spread).sqrt();
    if whole[untuned] - whole[best] > error {
        (candidates[best].0, true)
    } else {
        (TableTuning::NONE, false)
    }
}

#[cfg(test)]
mod tests;
