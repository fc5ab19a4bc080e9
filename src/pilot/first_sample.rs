//! Replaces a choice whose first sample does not fit into the time of a render.

use super::window::pilot_window;
use super::{Choice, Contender, PATHS_PER_SECOND, as_many_photons, usual_cost};
use crate::image::film::{Film, FilmError};
use crate::integrator::{FIRST_OVERRUN, Picture, Settings, View};
use std::time::{Duration, Instant};

/// Share of the pixels on which the time of a sample is measured.
const SHARE: f64 = 1.0 / 64.0;

/// Largest assumed ratio of a sample's cost to its usual cost.
const DEARER: f64 = 16.0;

/// Keeps a choice if one whole sample of it fits into the time limit of the first sample of a render with the time
/// `left`. Otherwise returns path tracing, because an incomplete first sample leaves pixels black. The decision depends
/// on measured time.
pub(crate) fn with_a_first_sample(
    choice: Choice,
    contenders: &[Contender],
    view: &View<'_>,
    left: Duration,
) -> Result<Choice, FilmError> {
    let best = &contenders[choice.best];
    let (frame, pixels) = (view.sensor.frame, view.window.len() as f64);
    let frames = f64::from(frame.x) * f64::from(frame.y) / pixels;
    let threads = rayon::current_num_threads() as f64;
    let usual = usual_cost(best, frames) * pixels / (PATHS_PER_SECOND * threads);
    let left = f64::from(FIRST_OVERRUN) * left.as_secs_f64();
    if best.kind.is_path() || DEARER * usual < left {
        return Ok(choice);
    }
    let (frame, window) = pilot_window(frame, view.window, (SHARE * pixels) as f32);
    let small = View::new(view.scene, view.sensor.camera, frame, window);
    let settings = Settings {
        estimator: as_many_photons(best.settings.estimator, view, &small),
        ..best.settings.clone()
    };
    let mut integrator = settings.integrator();
    let start = Instant::now();
    integrator.prepare(&small);
    // The render repeats this preparation.
    let aim = start.elapsed().as_secs_f64();
    let mut picture = Picture::new(Film::cropped(frame, window)?);
    let mut fits = |sample: u32| {
        let clock = Instant::now();
        integrator.pass(&small, sample..sample + 1, &mut picture);
        let seconds = clock.elapsed().as_secs_f64() * pixels / window.len() as f64;
        start.elapsed().as_secs_f64() + aim + seconds <= left
    };
    // The first sample may have been slowed by other work.
    if fits(0) || fits(1) {
        return Ok(choice);
    }
    let path = |c: &Contender| c.kind.is_path();
    let best = contenders.iter().rposition(path).unwrap_or(0);
    Ok(Choice {
        best,
        name: contenders[best].name(),
        chosen: None,
        trials: Vec::new(),
        why: "a sample of the one that the scene calls for takes longer than there is time",
        ..choice
    })
}
