//! The level of a table for a scene, and how much of its pattern, chosen from a pilot without a reference.
//!
//! How much blur a scene bears is not in a path's class, so that a table serves other scenes than those it was learned
//! from only at a level of their own; and where a scene is unlike all of those, one factor for all paths is better than
//! the pattern. A pilot renders the scene with the table at a few scales and contrasts (see
//! [`AttenuationTable::with_contrast`]) *on the same paths*, as the plain path tracer too. The difference of two such
//! pictures has hardly any noise but that of the roughened connections, so that its square, made unbiased over
//! independent batches, is an estimate of bias²; the film gives the variance. The candidate with the least
//! bias² + variance / N wins, so that a longer render is roughened less. All candidates run a heat of a quarter of the
//! paths; the few best of it get the rest.

mod candidate;

use crate::image::film::{FilmError, Window};
use crate::integrator::{Estimator, Settings, View};
use crate::math::UVec2;
use crate::regularise::{AttenuationTable, Rule};
use candidate::{BATCHES, Entrant, TILE, Tiles};

/// How much of the pattern is tried: all, half, and none.
pub const CONTRASTS: [f32; 3] = [1.0, 0.5, 0.0];

/// The scales that are tried with each.
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

/// All candidates get one path in so many.
const HEAT: u32 = 4;

/// Candidates that get the other paths too; so does no change.
const FINALISTS: usize = 6;

/// Pixels of the pilot's picture, about.
const PIXELS: f32 = 4096.0;

/// Paths of one level for each sample of the final render: few samples need only a rough level.
const PATHS_PER_SAMPLE: u64 = 2500;

/// Fewest and most paths of one level.
const PATHS: (u64, u64) = (100_000, 1_000_000);

/// What dark pixels are measured against: the mean of the picture counts as 0.3.
const EPSILON: f64 = 0.01;

/// A way to change a table for a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// How much of its pattern is left, from 0 to 1.
    pub contrast: f32,
    /// What its factors are multiplied by.
    pub scale: f32,
}

impl Change {
    /// None.
    pub const NONE: Self = Self {
        contrast: 1.0,
        scale: 1.0,
    };

    /// The changed table.
    pub fn of(self, table: &AttenuationTable) -> AttenuationTable {
        let mut changed = table.with_contrast(self.contrast);
        changed.scale *= self.scale;
        changed
    }

    fn all() -> impl Iterator<Item = Self> {
        let scales = |contrast| SCALES.map(|scale| Self { contrast, scale });
        CONTRASTS.into_iter().flat_map(scales)
    }
}

/// Estimated error of one candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// What is done to the table.
    pub change: Change,
    /// Relative bias², an unbiased estimate: below 0 by chance.
    pub bias2: f64,
    /// Relative variance of one sample over the number of samples.
    pub variance: f64,
    /// Relative change of the picture's mean.
    pub energy: f64,
}

/// What the pilot found.
#[derive(Clone, Debug, PartialEq)]
pub struct Pilot {
    /// What to render with: no change where the pilot cannot tell.
    pub change: Change,
    /// Whether a change was found better by more than the pilot's own noise.
    pub decided: bool,
    /// What was found at [`SCALES`], contrast by contrast: from all paths for the best few, else from the heat's.
    pub levels: Vec<Level>,
    /// Paths traced.
    pub paths: u64,
}

impl Pilot {
    /// The best of what was tried that changes the mean of the picture by at most this share; what changes it least if
    /// everything changes it by more.
    ///
    /// Errors of pixels alone favour pictures that are smooth and dark: where all light comes through glass, the best
    /// constant gives up a fifth of it.
    pub fn within(&self, share: f64) -> Change {
        let off = |level: &&Level| (level.energy.abs() - share).max(0.0);
        let order = |a: &&Level, b: &&Level| {
            let errors = a.error().total_cmp(&b.error());
            off(a).total_cmp(&off(b)).then(errors)
        };
        let best = self.levels.iter().min_by(order);
        best.map_or(Change::NONE, |level| level.change)
    }
}

impl Level {
    /// Bias² and variance together.
    pub fn error(&self) -> f64 {
        self.bias2.max(0.0) + self.variance
    }
}

/// Chooses how the table in `settings` is changed for a render of `samples` samples per pixel of a view.
///
/// Settings without a table, and scenes without anything to roughen, are not tried. The reuse mode is tried in the
/// default mode: its paths would not be the same from level to level. Fails where the window leaves the frame.
pub fn choose(settings: &Settings, view: &View<'_>, samples: u32) -> Result<Pilot, FilmError> {
    let Some(table) = settings.rule.table().filter(|_| view.scene.has_lobes()) else {
        return Ok(Pilot {
            change: Change::NONE,
            decided: false,
            levels: Vec::new(),
            paths: 0,
        });
    };
    let (frame, window) = pilot_window(view.sensor.frame, view.window);
    let view = View::new(view.scene, view.sensor.camera, frame, window);
    let (pixels, count) = (window.len() as u64, BATCHES as u64);
    let wanted = (PATHS_PER_SAMPLE * u64::from(samples)).clamp(PATHS.0, PATHS.1);
    let spp = (wanted / (count * pixels)).max(2) as u32;
    let heat = (spp / HEAT).max(2)..spp;
    let entrant = |rule: Rule| {
        let settings = Settings {
            estimator: Estimator::Path { reuse: false },
            rule,
            ..settings.clone()
        };
        let mut entrant = Entrant::new(&settings, &view)?;
        entrant.trace(&view, spp, 0..heat.start);
        Ok(entrant)
    };
    let mut plain = entrant(Rule::Plain)?;
    let mut entrants = Change::all()
        .map(|change| entrant(Rule::with_table(change.of(table))))
        .collect::<Result<Vec<Entrant>, FilmError>>()?;
    let tiles = |(change, entrant): (Change, &Entrant)| (change, entrant.tiles(window));
    let heats: Vec<(Change, Tiles)> = Change::all().zip(&entrants).map(tiles).collect();
    // The roughest one is the least noisy picture.
    let weights = weights(&heats[SCALES.len() - 1].1);
    let all: Vec<usize> = (0..BATCHES).collect();
    let measured = |plain: &Tiles, levels: &[(Change, Tiles)]| -> Vec<Level> {
        (levels.iter())
            .map(|level| measure(plain, level, &weights, samples, &all))
            .collect()
    };
    let mut levels = measured(&plain.tiles(window), &heats);
    let finalists = finalists(&levels);
    plain.trace(&view, spp, heat.clone());
    for &finalist in &finalists {
        entrants[finalist].trace(&view, spp, heat.clone());
    }
    let finals: Vec<(Change, Tiles)> = (finalists.iter())
        .map(|&finalist| tiles((levels[finalist].change, &entrants[finalist])))
        .collect();
    let plain = plain.tiles(window);
    for (&finalist, level) in finalists.iter().zip(measured(&plain, &finals)) {
        levels[finalist] = level;
    }
    let (change, decided) = decide(&plain, &finals, &weights, samples);
    let passes = heat.start as usize * (entrants.len() + 1) + heat.len() * (finals.len() + 1);
    Ok(Pilot {
        change,
        decided,
        levels,
        paths: passes as u64 * count * pixels,
    })
}

/// Which candidates are worth more paths, in their order: the best ones, and no change.
fn finalists(levels: &[Level]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..levels.len()).collect();
    order.sort_by(|&a, &b| levels[a].error().total_cmp(&levels[b].error()));
    let best = &order[..FINALISTS.min(order.len())];
    (0..levels.len())
        .filter(|i| best.contains(i) || levels[*i].change == Change::NONE)
        .collect()
}

/// Size of the pilot's whole picture, and its window: whole tiles.
fn pilot_window(frame: UVec2, window: Window) -> (UVec2, Window) {
    let scale = (PIXELS / window.len().max(1) as f32).sqrt();
    let side = |x: u32| ((x as f32 * scale / TILE as f32).round() as u32).clamp(2, 256) * TILE;
    let start = |x: u32| (x as f32 * scale).round() as u32;
    let pilot = Window {
        x: start(window.x),
        y: start(window.y),
        w: side(window.w),
        h: side(window.h),
    };
    // A window of the whole frame stays one.
    let edge = |frame: u32, from: u32, length: u32, end: u32| {
        if from + length == frame {
            end
        } else {
            ((frame as f32 * scale).round() as u32).max(end)
        }
    };
    let frame = UVec2::new(
        edge(frame.x, window.x, window.w, pilot.x + pilot.w),
        edge(frame.y, window.y, window.h, pilot.y + pilot.h),
    );
    (frame, pilot)
}

/// 1 / (radiance² + ε) of every tile, at a brightness of 0.3.
fn weights(level: &Tiles) -> Vec<f64> {
    let count = level.variance.len();
    let mean = |t: usize| -> f64 {
        let sum: f64 = level.means.iter().map(|m| m[t].iter().sum::<f64>()).sum();
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
    (change, level): &(Change, Tiles),
    weights: &[f64],
    samples: u32,
    batches: &[usize],
) -> Level {
    let pairs = (batches.len() * (batches.len() - 1)) as f64;
    let (mut bias2, mut variance) = (0.0, 0.0);
    let (mut change_of_mean, mut mean) = (0.0, 0.0);
    for (t, weight) in weights.iter().enumerate() {
        for c in 0..3 {
            let (mut sum, mut squares) = (0.0, 0.0);
            for &b in batches {
                let d = level.means[b][t][c] - plain.means[b][t][c];
                sum += d;
                squares += d * d;
                mean += plain.means[b][t][c];
            }
            change_of_mean += sum;
            bias2 += weight * (sum * sum - squares) / pairs / 3.0;
        }
        variance += weight * level.variance[t] / f64::from(samples.max(1));
    }
    let count = weights.len().max(1) as f64;
    Level {
        change: *change,
        bias2: bias2 / count,
        variance: variance / count,
        energy: change_of_mean / mean.max(1e-30),
    }
}

/// The best candidate, if it beats no change by more than the jackknife's standard error of the difference.
fn decide(
    plain: &Tiles,
    levels: &[(Change, Tiles)],
    weights: &[f64],
    samples: u32,
) -> (Change, bool) {
    let errors = |batches: &[usize]| -> Vec<f64> {
        (levels.iter())
            .map(|level| measure(plain, level, weights, samples, batches).error())
            .collect()
    };
    let all: Vec<usize> = (0..BATCHES).collect();
    let one = (levels.iter())
        .position(|l| l.0 == Change::NONE)
        .unwrap_or(0);
    let whole = errors(&all);
    let best = (0..whole.len())
        .min_by(|&a, &b| whole[a].total_cmp(&whole[b]))
        .unwrap_or(one);
    let gains: Vec<f64> = (0..BATCHES)
        .map(|left_out| {
            let batches: Vec<usize> = (0..BATCHES).filter(|&b| b != left_out).collect();
            let errors = errors(&batches);
            errors[one] - errors[best]
        })
        .collect();
    let n = BATCHES as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let spread: f64 = gains.iter().map(|g| (g - mean).powi(2)).sum();
    let error = ((n - 1.0) / n * spread).sqrt();
    if whole[one] - whole[best] > error {
        (levels[best].0, true)
    } else {
        (Change::NONE, false)
    }
}

#[cfg(test)]
mod tests;
