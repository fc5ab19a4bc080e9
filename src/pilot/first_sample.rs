//! Replaces a choice whose first sample does not fit into the time of a render.

use super::window::pilot_window;
use super::{Choice, Contender, PATHS_PER_SECOND, as_many_photons, usual_cost};
use crate::image::film::{Film, FilmError};
use crate::integrator::{Picture, Settings, View, first_limit};
use std::time::{Duration, Instant};

/// Share of the pixels on which the time of a sample is measured.
const SHARE: f64 = 1.0 / 64.0;

/// Largest assumed ratio of a sample's cost to its usual cost.
const DEARER: f64 = 16.0;

/// Largest assumed ratio of a measured time to that of a processor without other work.
const SLOWED: f64 = 3.0;

/// Keeps a choice if one whole sample of it fits into the time limit of the first sample of a render with the time
/// `left`. Otherwise returns the dearest other contender whose sample fits, and path tracing if there is none, because
/// an incomplete first sample leaves pixels black. The decision depends on measured time.
pub(crate) fn with_a_first_sample(
    choice: Choice,
    contenders: &[Contender],
    view: &View<'_>,
    left: Duration,
) -> Result<Choice, FilmError> {
    let clock = Instant::now();
    let frame = view.sensor.frame;
    let frames = f64::from(frame.x) * f64::from(frame.y) / view.window.len() as f64;
    let cost = |i: &usize| usual_cost(&contenders[*i], frames);
    let is_path = |i: &usize| contenders[*i].kind.is_path();
    let mut others: Vec<usize> = (0..contenders.len())
        .filter(|i| !is_path(i) && cost(i) < cost(&choice.best))
        .collect();
    others.sort_by(|a, b| cost(b).total_cmp(&cost(a)));
    for best in std::iter::once(choice.best).chain(others) {
        if is_path(&best) || fits(&contenders[best], cost(&best), view, left, clock)? {
            return Ok(match best == choice.best {
                true => choice,
                false => instead(choice, contenders, best),
            });
        }
    }
    let best = (0..contenders.len()).rfind(is_path).unwrap_or(0);
    Ok(instead(choice, contenders, best))
}

/// A choice with another contender.
fn instead(choice: Choice, contenders: &[Contender], best: usize) -> Choice {
    Choice {
        best,
        name: contenders[best].name(),
        chosen: None,
        trials: Vec::new(),
        why: "a sample of the one that the scene calls for takes longer than there is time",
        ..choice
    }
}

/// True if a sample of a contender of this usual cost is within the time limit of a render that has the time `left`
/// from the start of a clock.
fn fits(
    contender: &Contender,
    cost: f64,
    view: &View<'_>,
    left: Duration,
    clock: Instant,
) -> Result<bool, FilmError> {
    let pixels = view.window.len() as f64;
    let threads = rayon::current_num_threads() as f64;
    if DEARER * cost * pixels / (PATHS_PER_SECOND * threads) < left.as_secs_f64() {
        return Ok(true);
    }
    let (frame, window) = pilot_window(view.sensor.frame, view.window, (SHARE * pixels) as f32);
    let small = View::new(view.scene, view.sensor.camera, frame, window);
    let settings = Settings {
        estimator: as_many_photons(contender.settings.estimator, view, &small),
        ..contender.settings.clone()
    };
    let mut integrator = settings.integrator();
    let start = Instant::now();
    integrator.prepare(&small);
    // The render repeats this preparation.
    let aim = start.elapsed().as_secs_f64();
    let mut picture = Picture::new(Film::cropped(frame, window)?);
    // The time of a whole sample over its limit.
    let mut excess = |sample: u32| {
        let start = Instant::now();
        integrator.pass(&small, sample..sample + 1, &mut picture);
        let seconds = start.elapsed().as_secs_f64() * pixels / window.len() as f64;
        let limit = first_limit(left.saturating_sub(clock.elapsed()));
        (aim + seconds) / limit.as_secs_f64()
    };
    // The first sample may have been slowed by other work.
    let first = excess(0);
    Ok(first <= 1.0 || first <= SLOWED && excess(1) <= 1.0)
}

#[cfg(test)]
mod tests;
