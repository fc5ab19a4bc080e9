//! The integrator of a scene, chosen by a pilot without a reference.
//!
//! All contenders render the scene small, each for the same share of the work. The variance of their pixels, over the
//! samples that each of them takes in the time of the render, is the error to be expected of it. A contender that misses
//! light looks noise-free: where it is darker than one that finds everything, by more than the noise of both, the missing
//! light counts too. Light that it can find, but seldom, counts as the least variance that hides it from the pilot; light
//! that it never finds stays missing however long the render. A contender that misses more than a hundredth of the light
//! is not chosen while there is another.
//!
//! Time is CPU time, or counted paths, each at what it costs in most scenes, for a choice that is the same every time.

use super::pilot_window;
use super::resolve::{Resolve, resolve_film};
use super::stopwatch::Stopwatch;
use crate::image::film::{Film, FilmError, Window};
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Picture, Settings, View};
use crate::sampler::{Domain, SamplerKind, Seed};
use crate::scene::{Camera, Scene};
use std::fmt;
use std::time::Duration;

/// Share of the render's work that the pilot takes, as long as its pictures are large enough.
const SHARE: f64 = 0.04;

/// Fewest and most pixels of the pilot's pictures.
const PIXELS: (f64, f64) = (1024.0, 4096.0);

/// Fewest and most samples per pixel of a contender: fewer have no variance worth the name.
const SAMPLES: (f64, f64) = (8.0, 1024.0);

/// Edge in pixels of the tiles on which means are compared.
const TILE: u32 = 8;

/// Camera paths per CPU-second that are assumed before any is measured, and where paths are counted instead of seconds.
const PATHS_PER_SECOND: f64 = 0.7e6;

/// ε of the relative errors, where the mean of the picture counts as 0.3.
const EPSILON: f64 = 0.01;

/// Standard errors by which a contender must be darker than another to miss light.
const DARKER: f64 = 2.0;

/// Share of the light that a contender may miss while there are others.
const MISSED: f64 = 0.01;

/// Share of the pixels, those of the largest errors, that are left out: what single bright samples bring is chance.
const TRIMMED: f64 = 0.002;

/// Factor on the variance of contenders that do not merge, where smooth glass makes caustics: what they find by rare bright
/// samples is seldom in the pilot. With factors up to 1.9 `bdpt` was chosen where `vcm` had 0.6 of its error.
const UNSEEN: f64 = 2.5;

/// An integrator that could render the picture.
#[derive(Clone, Debug)]
pub struct Contender {
    /// Its name.
    pub kind: IntegratorKind,
    /// All that its picture depends on.
    pub settings: Settings,
}

/// Length of the render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Horizon {
    /// The time that the path tracer takes for so many samples per pixel.
    Samples(u32),
    /// CPU-seconds over all threads.
    Seconds(f64),
}

/// A contender as the pilot saw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Its name.
    pub kind: IntegratorKind,
    /// Samples per pixel that it takes in the time of the render.
    pub samples: f64,
    /// Expected relMSE at the end of the render.
    pub error: f64,
    /// Share of the picture's light that it misses, as far as that is more than noise.
    pub missed: f64,
}

/// Outcome of a pilot.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Place of the best contender.
    pub best: usize,
    /// Contenders that were tried, in their order.
    pub trials: Vec<Trial>,
    /// Place of the best among them.
    pub chosen: Option<usize>,
    /// CPU-seconds of the pilot.
    pub seconds: f64,
}

impl fmt::Display for Choice {
    /// What was chosen, and what the others would have cost.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(chosen) = self.chosen.map(|chosen| self.trials[chosen]) else {
            return write!(out, "integrator path: there is nothing to choose");
        };
        let (name, error) = (chosen.kind.name(), chosen.error);
        write!(
            out,
            "integrator {name}: expected relMSE {error:.1e} in the time of this render"
        )?;
        for trial in self.trials.iter().filter(|t| t.kind != chosen.kind) {
            let ratio = trial.error / error;
            write!(out, "; {} {ratio:.1} times that", trial.kind.name())?;
            if trial.missed >= MISSED {
                write!(
                    out,
                    " and misses {:.0} % of the light",
                    100.0 * trial.missed
                )?;
            }
        }
        if self.trials.len() == 1 {
            write!(out, "; nothing else is worth a try in this scene")?;
        }
        write!(out, " (pilot: {:.2} CPU-seconds)", self.seconds)
    }
}

/// The integrator that a scene's lights and materials call for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    /// Its name.
    pub kind: IntegratorKind,
    /// The reason, in words.
    pub why: &'static str,
}

/// Roughness below which a lobe makes caustics that no light sample finds.
const SHARP: f32 = 0.1;

/// Names the integrator that a scene's lights and materials call for. Nothing is rendered, so reflections that are out of
/// sight count as much as others; a pilot knows better.
pub fn advise(scene: &Scene) -> Advice {
    let parts = scene.parts();
    let advice = |kind, why| Advice { kind, why };
    let (punctual, area) = (
        !parts.lights.is_empty(),
        scene.lights().emissive_triangles() > 0,
    );
    let [glass, mirror] = sharp(scene);
    if scene.has_dispersion() {
        return advice(IntegratorKind::Path, "nothing else has dispersion");
    }
    match (punctual, area) {
        (false, false) if scene.lights().is_empty() => {
            advice(IntegratorKind::Path, "there is no light")
        }
        (false, false) => advice(IntegratorKind::Path, "all light comes from the environment"),
        _ if glass && scene.has_overlaps() => advice(
            IntegratorKind::Bdpt,
            "caustics of smooth glass, whose bodies overlap: that vcm does not know",
        ),
        (true, _) if glass => advice(
            IntegratorKind::Vcm,
            "lights without area and smooth glass: only photons find caustics that are seen through it",
        ),
        (true, _) if mirror => advice(
            IntegratorKind::Bdpt,
            "lights without area and mirrors: path finds nothing that they light by way of a mirror, and the light's own \
             reflection takes --mode mollifier",
        ),
        (false, true) if glass => advice(
            IntegratorKind::Vcm,
            "lamps and smooth glass: caustics, also seen through the glass",
        ),
        (false, true) if mirror => advice(
            IntegratorKind::Bdpt,
            "lamps and sharp metal: caustics, which light paths find",
        ),
        _ => advice(
            IntegratorKind::Path,
            "no caustics: no smooth glass and no sharp metal",
        ),
    }
}

/// True for sharp transmission, and for sharp metal, among the materials.
fn sharp(scene: &Scene) -> [bool; 2] {
    let mut found = [false; 2];
    for m in &scene.parts().materials {
        let sharp = m.alpha < SHARP || m.metallic_roughness_texture.is_some();
        found[0] |= sharp && m.transmission > 0.0;
        found[1] |= sharp && m.metallic > 0.5;
    }
    found
}

/// True if the pilot should try an integrator: it knows the scene, and the scene could call for it.
fn is_worth_a_try(contender: &Contender, scene: &Scene, camera: &Camera) -> bool {
    let knows = contender.settings.check_scene(scene, camera).is_ok();
    let caustics = sharp(scene).contains(&true);
    knows
        && match contender.kind {
            IntegratorKind::Path => true,
            IntegratorKind::Bdpt => !scene.lights().is_empty(),
            _ => caustics && !scene.lights().is_empty(),
        }
}

/// Cost of a sample per pixel over that of the path tracer, in most scenes; light paths are as many as pixels of the full
/// frame, `frames` times those of the picture.
fn usual_cost(contender: &Contender, frames: f64) -> f64 {
    match contender.kind {
        IntegratorKind::Light => 1.3 * frames,
        IntegratorKind::Bdpt => 1.6 + 1.2 * frames,
        IntegratorKind::Vcm => 3.0 + 1.5 * frames,
        IntegratorKind::Sppm => 0.5 + 1.0 * frames,
        _ if contender.settings.levels.is_empty() => 1.0,
        _ => 1.35,
    }
}

/// Time of a render that is left after its pilot: enough for a pass, or there would be no picture.
pub fn left_after(time: Duration, pilot: Duration) -> Duration {
    time.saturating_sub(pilot).max(Duration::from_nanos(1))
}

/// Chooses an integrator for a render of a view; the first contender must be the path tracer. `counted` takes counted paths
/// for time, so that the choice depends on the arguments alone.
///
/// Given up with `None` when `go_on` says no; it is asked before every small render. Fails where the window leaves the
/// frame.
pub fn choose_integrator(
    contenders: &[Contender],
    view: &View<'_>,
    horizon: Horizon,
    counted: bool,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<Choice>, FilmError> {
    let pilot = Stopwatch::start();
    let (frame, window) = (view.sensor.frame, view.window);
    Film::check(frame, window)?;
    let (scene, camera) = (view.scene, view.sensor.camera);
    let places: Vec<usize> = (0..contenders.len())
        .filter(|&i| is_worth_a_try(&contenders[i], scene, camera))
        .collect();
    let pixels = window.len() as f64;
    let frames = f64::from(frame.x) * f64::from(frame.y) / pixels;
    let cost = |i: usize| usual_cost(&contenders[i], frames);
    let mut rate = PATHS_PER_SECOND;
    let small = |pixels: f64| {
        let (frame, window) = pilot_window(frame, window, pixels as f32);
        View::new(scene, camera, frame, window)
    };
    if !counted && let Horizon::Seconds(_) = horizon {
        // One sample per pixel of the path tracer tells how large the pilot may be.
        let view = small(PIXELS.0);
        let (_, seconds) = rendered(&contenders[0].settings, &view, 1, 0)?;
        rate = view.window.len() as f64 / seconds.max(1e-6);
    }
    let paths = match horizon {
        Horizon::Samples(samples) => f64::from(samples) * pixels,
        Horizon::Seconds(seconds) => seconds * rate,
    };
    let each = SHARE * paths / places.len().max(1) as f64;
    let dearest = places.iter().map(|&i| cost(i)).fold(1.0, f64::max);
    let view = small((each / (SAMPLES.0 * dearest)).clamp(PIXELS.0, PIXELS.1));
    let mut drafts = Vec::new();
    for &i in &places {
        if !go_on() {
            return Ok(None);
        }
        let of_pilot = view.window.len() as f64;
        let samples = (each / (cost(i) * of_pilot)).clamp(SAMPLES.0, SAMPLES.1) as u32;
        let contender = &contenders[i];
        let (picture, seconds) =
            rendered(&contender.settings, &view, samples, 1 + drafts.len() as u64)?;
        let (tiles, cost) = (
            Tiles::of(&picture, samples),
            match counted {
                true => cost(i),
                false => seconds / (f64::from(samples) * of_pilot),
            },
        );
        drafts.push(Draft {
            kind: contender.kind,
            samples,
            cost,
            tiles,
        });
    }
    let time = match horizon {
        Horizon::Samples(samples) => f64::from(samples) * drafts[0].cost,
        Horizon::Seconds(_) if counted => paths / pixels,
        Horizon::Seconds(seconds) => seconds / pixels,
    };
    let punctual = !scene.parts().lights.is_empty();
    let trials = judged(&drafts, time, punctual, sharp(scene)[0]);
    let chosen = best(&trials);
    Ok(Some(Choice {
        best: chosen.map_or(0, |chosen| places[chosen]),
        chosen,
        trials,
        seconds: pilot.seconds().1,
    }))
}

/// A small picture with random numbers of its own, and its CPU-seconds.
fn rendered(
    settings: &Settings,
    view: &View<'_>,
    samples: u32,
    number: u64,
) -> Result<(Picture, f64), FilmError> {
    let settings = Settings {
        // A picture that shares paths with its pilot would favour what these paths favour.
        seed: Seed(settings.seed).derive(Domain::Pilot, 1 + number).0,
        // The film's variances decide.
        sampler: SamplerKind::Independent,
        ..settings.clone()
    };
    let mut picture = Picture::new(Film::cropped(view.sensor.frame, view.window)?);
    let watch = Stopwatch::start();
    (settings.integrator()).pass(view, 0..samples, &mut picture);
    let (_, cpu) = watch.seconds();
    Ok((picture, cpu))
}

/// A contender's small picture.
struct Draft {
    kind: IntegratorKind,
    /// Samples per pixel.
    samples: u32,
    /// Time of a sample per pixel.
    cost: f64,
    tiles: Vec<Tile>,
}

/// A tile of a small picture, the channels taken together.
#[derive(Clone, Debug)]
struct Tile {
    mean: f64,
    /// Variance of that mean.
    variance: f64,
    /// Variance of a sample of every pixel: what a picture's error comes from.
    of_sample: Vec<f64>,
}

struct Tiles;

impl Tiles {
    /// The tiles of a picture of so many samples per pixel.
    fn of(picture: &Picture, samples: u32) -> Vec<Tile> {
        let Picture { film, levels, .. } = picture;
        let (mean, error) = match levels {
            Some(levels) => {
                let resolved = resolve_film(levels, Resolve::default());
                let absolute = |(m, e): (&crate::math::Rgb, f32)| {
                    let squared = m.as_dvec3().powf(2.0).element_sum() / 3.0 + EPSILON;
                    f64::from(e) * f64::from(e) * squared
                };
                let errors = resolved.error();
                let pixels = resolved.picture.pixels.iter().zip(errors);
                let error: Vec<f64> = pixels.map(absolute).collect();
                (resolved.picture, error)
            }
            None => {
                let variance = film.variance_of_mean();
                let each = |v: &crate::math::Rgb| v.as_dvec3().element_sum() / 3.0;
                (film.mean(), variance.pixels.iter().map(each).collect())
            }
        };
        let window = film.window;
        let tile = |w: &Window| {
            let (mut sum, mut squares) = (0.0, 0.0);
            let mut of_sample = Vec::with_capacity(w.len());
            for pixel in super::candidate::inside(w, &window) {
                sum += mean.pixels[pixel].as_dvec3().element_sum() / 3.0;
                squares += error[pixel];
                of_sample.push(error[pixel] * f64::from(samples));
            }
            let pixels = w.len() as f64;
            Tile {
                mean: sum / pixels,
                variance: squares / (pixels * pixels),
                of_sample,
            }
        };
        window.tiles(TILE).iter().map(tile).collect()
    }
}

/// Contenders by the light that they can find at all, most first.
const SEEING: [IntegratorKind; 4] = [
    IntegratorKind::Vcm,
    IntegratorKind::Bdpt,
    IntegratorKind::Sppm,
    IntegratorKind::Path,
];

/// The contenders against the one that finds most light, for a render of this time per pixel; `punctual` if there are
/// lights without area, `glass` if there is smooth glass.
fn judged(drafts: &[Draft], time: f64, punctual: bool, glass: bool) -> Vec<Trial> {
    let of = |kind: &IntegratorKind| drafts.iter().find(|d| d.kind == *kind);
    let Some(truth) = SEEING.iter().find_map(of).map(|d| &d.tiles) else {
        return Vec::new();
    };
    let count = truth.len().max(1) as f64;
    let whole = truth.iter().map(|t| t.mean).sum::<f64>() / count;
    let gain = 0.3 / whole.max(1e-30);
    drafts
        .iter()
        .map(|draft| {
            let samples = (time / draft.cost).max(1.0);
            // The radius of merges shrinks, so that the variance of a sample rises with n^(1 − α).
            let grown = match draft.kind {
                IntegratorKind::Sppm => (samples / f64::from(draft.samples)).max(1.0).cbrt(),
                IntegratorKind::Vcm => 1.0,
                _ if glass => UNSEEN,
                _ => 1.0,
            };
            // Light paths alone never find what is seen by way of a Dirac lobe, others no light without area there.
            let blind = match draft.kind {
                IntegratorKind::Light => true,
                IntegratorKind::Path | IntegratorKind::Bdpt => punctual,
                _ => false,
            };
            let (mut errors, mut missed) = (Vec::new(), 0.0);
            for (tile, true_tile) in draft.tiles.iter().zip(truth) {
                let noise = DARKER * (tile.variance + true_tile.variance).sqrt();
                let dark = (true_tile.mean - tile.mean - noise).max(0.0);
                missed += dark;
                // Light that none of n samples found has a second moment of at least n times its squared mean.
                let hidden = match blind {
                    true => samples,
                    false => samples.min(f64::from(draft.samples) * tile.of_sample.len() as f64),
                };
                let least = dark * dark * hidden;
                let relative = gain * gain / ((gain * true_tile.mean).powi(2) + EPSILON);
                let second = tile.of_sample.iter().map(|v| (v * grown).max(least));
                errors.extend(second.map(|v| relative * v / samples));
            }
            errors.sort_by(f64::total_cmp);
            errors.truncate(((1.0 - TRIMMED) * errors.len() as f64).ceil() as usize);
            let error = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
            Trial {
                kind: draft.kind,
                samples,
                error,
                missed: missed / count / whole.max(1e-30),
            }
        })
        .collect()
}

/// The place of the least error among those that miss no light; among all if every one does.
fn best(trials: &[Trial]) -> Option<usize> {
    let order = |&a: &usize, &b: &usize| {
        let (a, b) = (&trials[a], &trials[b]);
        let misses = |t: &Trial| t.missed >= MISSED;
        (misses(a).cmp(&misses(b))).then(a.error.total_cmp(&b.error))
    };
    (0..trials.len()).min_by(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draft(kind: IntegratorKind, cost: f64, mean: f64, of_sample: f64) -> Draft {
        let tile = Tile {
            mean,
            variance: of_sample / (16.0 * 64.0),
            of_sample: vec![of_sample; 64],
        };
        Draft {
            kind,
            samples: 16,
            cost,
            tiles: vec![tile; 16],
        }
    }

    /// Noise over the samples that fit, and light that is missed: for good, or until it is found.
    #[test]
    fn pilot_weighs_noise_cost_and_missing_light() {
        let [path, bdpt, vcm] = [
            IntegratorKind::Path,
            IntegratorKind::Bdpt,
            IntegratorKind::Vcm,
        ];
        let drafts = [
            draft(path, 1.0, 1.0, 4.0),
            draft(bdpt, 2.0, 1.0, 1.0),
            draft(vcm, 8.0, 1.0, 0.5),
        ];
        let trials = judged(&drafts, 800.0, true, false);
        let ratio = |i: usize| trials[i].error / trials[0].error;
        assert!((ratio(1) - 0.5).abs() < 1e-9 && (ratio(2) - 1.0).abs() < 1e-9);
        assert!(trials.iter().all(|t| t.missed == 0.0));
        assert_eq!(best(&trials), Some(1));
        // Rare bright samples are seldom in a pilot.
        let trials = judged(&drafts, 800.0, true, true);
        assert_eq!(best(&trials), Some(2));
        // A path tracer that is dark for want of light has no noise and the largest error.
        let drafts = [draft(path, 1.0, 0.0, 0.0), draft(vcm, 8.0, 1.0, 0.5)];
        for (punctual, least) in [(true, 0.5), (false, 0.4)] {
            let trials = judged(&drafts, 1600.0, punctual, false);
            assert!(trials[0].error > least && trials[0].error > 100.0 * trials[1].error);
            assert!(trials[0].missed > 0.9);
        }
        // Light that can be found is found in time; light that cannot is not.
        let long = |punctual| judged(&drafts, 1e6, punctual, false)[0].error;
        assert!(long(false) < 0.01 && long(true) > 0.5);
        // A picture that lacks light is no bargain.
        let drafts = [draft(path, 1.0, 0.7, 0.0), draft(vcm, 8.0, 1.0, 1.0)];
        let trials = judged(&drafts, 16.0, true, false);
        assert!(trials[0].error < trials[1].error && trials[0].missed > 0.01);
        assert_eq!(best(&trials), Some(1));
    }
}
