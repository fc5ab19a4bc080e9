//! The integrator of a scene, chosen by a pilot without a reference.
//!
//! The scene's lights and materials suggest one of the contenders ([`advise`]), and light paths show whether mirrors
//! throw caustics that camera paths rarely find. The suggestion is taken unless the pilot shows that another contender
//! is clearly better. In a race, all contenders render the scene small for about the same work, those far behind drop
//! out, and the others double their samples, until one is left or a twentieth of the render's work is spent. There is no
//! race if that is less than the first round. The pilot's samples are no part of the picture. `judge` compares its
//! pictures.
//!
//! Work is counted in camera paths, at the usual cost of each integrator's samples, so that a choice depends on its
//! arguments alone. If the render's length is in seconds, the clock can also end a race.

mod first_sample;
mod judge;
mod photons;
pub mod stopwatch;
pub(crate) mod window;
pub mod witness;

use crate::image::film::{Film, FilmError};
use crate::integrator::bidirectional::{MAX_LIGHT_PATHS, Radius, Strategies};
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Estimator, Integrator, Picture, Settings, View};
use crate::math::UVec2;
use crate::regularise::Rule;
use crate::sampler::{Domain, SamplerKind, Seed};
use crate::scene::Scene;
pub(crate) use first_sample::with_a_first_sample;
use judge::{PilotPicture, best, judged};
use std::fmt;
use std::time::Duration;
use stopwatch::Stopwatch;
use window::pilot_window;

/// Share of the render's work that the race may take.
const SHARE: f64 = 0.05;

/// Most work of a race in camera paths, 1.5 CPU-seconds. The bound lets a crop choose as its whole frame does.
const MAX_PATHS: f64 = (1 << 20) as f64;

/// Share of the render's work that the first round should take.
const FIRST_SHARE: f64 = 0.02;

/// Fewest and most pixels of the pilot's pictures.
const PIXELS: (f64, f64) = (1024.0, 4096.0);

/// Work of a contender's first round in path-tracer samples per pixel; fewest and most samples per pixel.
const FIRST: f64 = 7.0;
const SAMPLES: (u32, u32) = (2, 1024);

/// Contenders with more than this multiple of the least error leave the race, unless they are advised.
const BEHIND: f64 = 2.0;

/// Camera paths per CPU-second, which convert the time of a render to work.
const PATHS_PER_SECOND: f64 = 0.7e6;

/// Samples per pixel that a pilot assumes for a render to a target error.
pub(crate) const SPP_OF_TARGET: u32 = 256;

/// Ratio of an environment's peak to its mean radiance above which it casts caustics like a lamp.
const PEAK: f32 = 100.0;

/// Share of the light that a contender may be unable to find while there are others.
pub(super) const MISSED: f64 = 0.01;

/// An integrator that could render the picture.
#[derive(Clone, Debug)]
pub(crate) struct Contender {
    /// Kind of integrator.
    pub kind: IntegratorKind,
    /// Settings that determine its picture.
    pub settings: Settings,
}

impl Contender {
    /// True if every pixel gets the best of several levels of roughening.
    fn has_levels(&self) -> bool {
        self.kind.is_path() && self.settings.amounts.has_choice()
    }

    /// Name for messages.
    fn name(&self) -> String {
        let levels = if self.has_levels() {
            " with levels"
        } else {
            ""
        };
        self.kind.to_string() + levels
    }
}

/// Length of the render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Horizon {
    /// The time that the path tracer takes for a number of samples per pixel.
    Samples(u32),
    /// CPU-seconds over all threads.
    Seconds(f64),
}

/// Result of the pilot for one contender.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trial {
    /// Kind of integrator.
    pub kind: IntegratorKind,
    /// True if every pixel gets the best of several levels of roughening.
    pub levels: bool,
    /// Samples per pixel in the time of the render.
    pub samples: f64,
    /// Expected relative error at the end of the render: mean over tiles of the root of their relMSE, at most 1 each.
    pub error: f64,
    /// Share of the picture's light that the contender can never find; 0 within noise.
    pub missed: f64,
}

impl Trial {
    /// The name of the contender.
    fn name(&self) -> String {
        let levels = if self.levels { " with levels" } else { "" };
        self.kind.to_string() + levels
    }
}

/// Outcome of a pilot.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Index of the best contender.
    pub best: usize,
    /// Name of the best contender.
    name: String,
    /// Results of the contenders in the race, in their order; empty if there was no race.
    pub(crate) trials: Vec<Trial>,
    /// Index of the best in `trials`; `None` without a race.
    pub chosen: Option<usize>,
    /// Index in `trials` of the advised contender.
    pub first: usize,
    /// Reason for the advice.
    pub why: &'static str,
    /// CPU-seconds of the pilot.
    pub seconds: f64,
}

impl Choice {
    /// Names the choice and the reason, in a few words.
    pub fn summary(&self) -> String {
        let why = match self.overruled() {
            Some(first) => format!("better than {first} in a small picture"),
            None => self.why.to_owned(),
        };
        format!("integrator {}: {why}", self.name)
    }

    /// Name of the advised contender, if another one was better.
    fn overruled(&self) -> Option<String> {
        let first = self.trials.get(self.first)?;
        (self.chosen != Some(self.first)).then(|| first.name())
    }
}

impl fmt::Display for Choice {
    /// Names the choice, its expected relative error, and the error ratios of the others.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.summary())?;
        let Some(place) = self.chosen else {
            return Ok(());
        };
        let error = self.trials[place].error;
        write!(
            out,
            "; expected relative error {error:.1e} in the time of this render"
        )?;
        for (_, trial) in (self.trials.iter().enumerate()).filter(|(i, _)| *i != place) {
            let ratio = trial.error / error.max(1e-30);
            write!(out, "; {} {ratio:.1} times that", trial.name())?;
            if trial.missed >= MISSED {
                write!(
                    out,
                    " and misses {:.0} % of the light",
                    100.0 * trial.missed
                )?;
            }
        }
        write!(out, " (pilot: {:.2} CPU-seconds)", self.seconds)
    }
}

/// Integrator that a scene's lights and materials suggest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    /// Kind of integrator.
    pub kind: IntegratorKind,
    /// The reason, in words.
    pub why: &'static str,
}

/// Roughness below which a lobe casts caustics that light sampling cannot find.
const SHARP: f32 = 0.1;

/// Suggests an integrator by a scene's lights and materials. Nothing is rendered, so invisible reflections count as
/// much as visible ones; a pilot is more accurate.
pub fn advise(scene: &Scene) -> Advice {
    let parts = scene.parts();
    let advice = |kind, why| Advice { kind, why };
    let (punctual, area) = (
        !parts.lights.is_empty(),
        scene.lights().emissive_triangles() > 0,
    );
    let [glass, mirror] = sharp(scene);
    if scene.scatters() && (glass || mirror) && (punctual || area || has_sun(scene)) {
        return advice(
            IntegratorKind::Bdpt,
            "caustics, and media that scatter, which only path and bdpt support",
        );
    }
    match (punctual, area) {
        (false, false) if scene.lights().is_empty() => {
            advice(IntegratorKind::Path, "there is no light")
        }
        (false, false) if !(glass && has_sun(scene)) => {
            advice(IntegratorKind::Path, "all light comes from the environment")
        }
        (true, _) if glass => advice(
            IntegratorKind::Vcm,
            "lights without area and smooth glass: only photons find caustics that are seen through it",
        ),
        (true, _) if mirror => advice(
            IntegratorKind::Bdpt,
            "lights without area and mirrors: path cannot find their light by way of a mirror, and the light's own \
             reflection needs --set mode=mollifier",
        ),
        (false, _) if glass => advice(
            IntegratorKind::Vcm,
            "lamps or a sun, and smooth glass: caustics, also seen through the glass",
        ),
        (false, _) if mirror => advice(
            IntegratorKind::Path,
            "lamps and sharp metal: reflected caustics, which roughened paths find",
        ),
        _ => advice(
            IntegratorKind::Path,
            "no caustics: no smooth glass and no sharp metal",
        ),
    }
}

/// True for an environment with a peak as bright as a sun's.
fn has_sun(scene: &Scene) -> bool {
    let environment = scene.parts().environment.as_ref();
    environment.is_some_and(|map| map.peak() > PEAK)
}

/// True for sharp transmission, and for sharp metal, among the materials.
fn sharp(scene: &Scene) -> [bool; 2] {
    let mut found = [false; 2];
    for m in &scene.parts().materials {
        let sharp = m.alpha < SHARP || m.metallic_roughness_texture.is_some();
        // Panes and boundaries of clouds let shadow rays through.
        found[0] |= sharp && m.transmission > 0.0 && !m.is_pane() && !m.is_null();
        found[1] |= sharp && m.metallic > 0.5;
    }
    found
}

/// Share of rare caustics from which the light of mirrors calls for photons.
const CAUSTICS: f64 = 0.005;

/// [`advise`] for a view: photons in place of camera paths if mirrors throw caustics that camera paths rarely find.
fn advise_view(view: &View<'_>, contenders: &[Contender]) -> Advice {
    let scene = view.scene;
    let advice = advise(scene);
    let [_, mirror] = sharp(scene);
    let area = scene.lights().emissive_triangles() > 0;
    let throws_caustics = |c: &Contender| {
        c.kind == IntegratorKind::Vcm
            && c.settings.check_scene(scene).is_ok()
            && c.settings
                .bidirectional(Strategies::All)
                .rare_caustics(view)
                >= CAUSTICS
    };
    if advice.kind.is_path()
        && mirror
        && (area || has_sun(scene))
        && contenders.iter().any(throws_caustics)
    {
        return Advice {
            kind: IntegratorKind::Vcm,
            why: "a small lamp or a sun, and mirrors: caustics that camera paths rarely find",
        };
    }
    advice
}

/// Indices of the contenders that the pilot should try: those that support the scene and could be best.
fn worth_a_try(contenders: &[Contender], scene: &Scene) -> Vec<usize> {
    let lit = !scene.lights().is_empty();
    let caustics = lit && sharp(scene).contains(&true);
    let knows = |c: &Contender| c.settings.check_scene(scene).is_ok();
    let is_worth = |c: &Contender| {
        knows(c)
            && match c.kind {
                IntegratorKind::Path => c.settings.rule == Rule::Plain || scene.features().lobes,
                IntegratorKind::Bdpt => lit,
                _ => caustics,
            }
    };
    let all = 0..contenders.len();
    all.filter(|&i| is_worth(&contenders[i])).collect()
}

/// Index among some contenders of the advised one; if it is not among them, of roughened path tracing, or else of the
/// first.
fn advised_index(kind: IntegratorKind, contenders: &[&Contender]) -> usize {
    let advised = |c: &&&Contender| c.kind == kind && !kind.is_path();
    let path = |c: &&&Contender| c.kind.is_path() && c.settings.rule != Rule::Plain;
    let place = |wanted: &dyn Fn(&&&Contender) -> bool| {
        (contenders.iter().enumerate()).find_map(|(i, c)| wanted(&c).then_some(i))
    };
    place(&advised).or_else(|| place(&path)).unwrap_or(0)
}

/// Usual cost of a sample per pixel over that of the path tracer. There is a light path for every pixel of the full
/// frame, which has `frames` times the pixels of the picture.
fn usual_cost(contender: &Contender, frames: f64) -> f64 {
    let has_levels = contender.kind.is_path() && contender.has_levels();
    let levels = if has_levels { 1.2 } else { 1.0 };
    levels * contender.settings.estimator.cost(frames)
}

/// Time of a render that is left after loading and pilot: at least a quarter, so that there is a picture.
pub(crate) fn left_after(time: Duration, spent: Duration) -> Duration {
    time.saturating_sub(spent).max(time / 4)
}

/// Chooses an integrator for a render of a view; the first contender must be the path tracer.
///
/// `None` if `go_on`, which is called before every small render, returns false. Fails if the window is not inside the
/// frame.
pub(crate) fn choose_integrator(
    contenders: &[Contender],
    view: &View<'_>,
    horizon: Horizon,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<Choice>, FilmError> {
    let pilot = Stopwatch::start();
    let (frame, window) = (view.sensor.frame, view.window);
    let (scene, camera) = (view.scene, view.sensor.camera);
    let places = worth_a_try(contenders, scene);
    let tried: Vec<&Contender> = places.iter().map(|&i| &contenders[i]).collect();
    let advice = advise_view(view, contenders);
    let advised = advised_index(advice.kind, &tried);
    let pixels = window.len() as f64;
    let frames = f64::from(frame.x) * f64::from(frame.y) / pixels;
    let usual = |i: usize| usual_cost(&contenders[i], frames);
    let first = |i: usize| ((FIRST / usual(i)).round() as u32).max(SAMPLES.0);
    let paths = match horizon {
        Horizon::Samples(samples) => f64::from(samples) * pixels,
        Horizon::Seconds(seconds) => seconds * PATHS_PER_SECOND,
    };
    let most = (SHARE * paths).min(MAX_PATHS);
    let round: f64 = places.iter().map(|&i| f64::from(first(i)) * usual(i)).sum();
    let small = (FIRST_SHARE * paths / round.max(1.0)).clamp(PIXELS.0, PIXELS.1);
    let (small_frame, small_window) = pilot_window(frame, window, small as f32);
    let small = View::new(scene, camera, small_frame, small_window);
    let small_pixels = small_window.len() as f64;
    let (mut trials, mut chosen) = (Vec::new(), None);
    if places.len() > 1 && round * small_pixels <= most {
        let mut runners = Vec::new();
        for (number, &i) in (1..).zip(&places) {
            let cost = usual(i);
            runners.push(Runner::new(
                &contenders[i],
                view,
                &small,
                number,
                first(i),
                cost,
            )?);
        }
        let punctual = !scene.parts().lights.is_empty();
        let before = pilot.seconds().1;
        'race: loop {
            for place in 0..runners.len() {
                if !runners[place].races {
                    continue;
                }
                if is_late(&runners, horizon, [before, pilot.seconds().1]) {
                    break 'race;
                }
                if !go_on() {
                    return Ok(None);
                }
                runners[place].run(&small);
            }
            let pilots: Vec<PilotPicture> = runners.iter().map(Runner::pilot).collect();
            trials = judged(&pilots, small_window, paths / pixels, punctual);
            let stay = still_racing(&runners, &trials, advised);
            if is_over(&runners, &stay, most / small_pixels) {
                break;
            }
            for (runner, stays) in runners.iter_mut().zip(stay) {
                runner.races = stays;
                runner.target_samples *= 2;
            }
        }
        chosen = best(&trials, advised);
    }
    let best = places.get(chosen.unwrap_or(advised)).copied().unwrap_or(0);
    Ok(Some(Choice {
        best,
        name: contenders[best].name(),
        chosen,
        first: advised,
        why: advice.why,
        trials,
        seconds: pilot.seconds().1,
    }))
}

/// True for contenders that stay in the race: the advised one, and those that are not far behind the best.
fn still_racing(runners: &[Runner], trials: &[Trial], advised: usize) -> Vec<bool> {
    let seen = |t: &&Trial| t.missed < MISSED;
    let least = (trials.iter().filter(seen)).fold(f64::INFINITY, |e, t| e.min(t.error));
    let stays = |t: &Trial| t.missed < MISSED && t.error < BEHIND * least;
    (runners.iter().zip(trials).enumerate())
        .map(|(i, (runner, trial))| runner.races && (i == advised || stays(trial)))
        .collect()
}

/// True if fewer than two contenders stay, if all rounds and the next would exceed `most` camera paths per pixel of the
/// pilot, or if the most samples are reached.
fn is_over(runners: &[Runner], stay: &[bool], most: f64) -> bool {
    let work = |runner: &Runner| f64::from(runner.samples) * runner.cost;
    let staying =
        || (runners.iter().zip(stay)).filter_map(|(runner, stays)| stays.then_some(runner));
    let spent: f64 = runners.iter().map(work).sum();
    let next: f64 = staying().map(work).sum();
    spent + next > most || runners.iter().any(|r| r.samples >= SAMPLES.1) || staying().count() < 2
}

/// True if the race would exceed its share of the render's seconds at the end of this round, extrapolated by work.
/// `before` and `now` are CPU-seconds of all threads of the process, at the start of the race and now.
fn is_late(runners: &[Runner], horizon: Horizon, [before, now]: [f64; 2]) -> bool {
    let Horizon::Seconds(seconds) = horizon else {
        return false;
    };
    let work = |samples: fn(&Runner) -> u32| -> f64 {
        (runners.iter().map(|r| f64::from(samples(r)) * r.cost)).sum()
    };
    let so_far = work(|r| r.samples);
    let end = work(|r| if r.races { r.target_samples } else { r.samples });
    so_far > 0.0 && before + (now - before) * end / so_far > SHARE * seconds
}

/// A contender in the race.
struct Runner {
    /// The contender with the settings of the pilot.
    contender: Contender,
    integrator: Box<dyn Integrator>,
    picture: Picture,
    /// Samples per pixel so far, and those after the next round.
    samples: u32,
    target_samples: u32,
    /// Cost of a sample per pixel over that of the path tracer.
    cost: f64,
    races: bool,
}

impl Runner {
    /// A contender before its first round with this number of samples, for the small picture of a view.
    fn new(
        contender: &Contender,
        view: &View<'_>,
        small: &View<'_>,
        number: u64,
        first: u32,
        cost: f64,
    ) -> Result<Self, FilmError> {
        let Contender { kind, settings } = contender;
        let settings = Settings {
            estimator: as_many_photons(settings.estimator, view, small),
            // With the render's own random numbers, the choice would favour what these happen to find.
            seed: Seed(settings.seed).derive(Domain::Pilot, 1 + number).0,
            // Variances decide, and they are valid for independent samples only.
            sampler: SamplerKind::Independent,
            ..settings.clone()
        };
        Ok(Self {
            integrator: settings.integrator(),
            picture: Picture::new(Film::cropped(small.sensor.frame, small.window)?),
            contender: Contender {
                kind: *kind,
                settings,
            },
            samples: 0,
            target_samples: first,
            cost,
            races: true,
        })
    }

    fn run(&mut self, view: &View<'_>) {
        self.integrator.prepare(view);
        (self.integrator).pass(view, self.samples..self.target_samples, &mut self.picture);
        self.samples = self.target_samples;
    }

    /// The small picture so far.
    fn pilot(&self) -> PilotPicture {
        PilotPicture::of(&self.contender, &self.picture, self.samples, self.cost)
    }
}

/// The estimator for the small picture of a view. Its light paths are fewer, so the radius grows until as many photons
/// merge as in the view. The automatic radius is bounded and would not grow enough.
fn as_many_photons(estimator: Estimator, view: &View<'_>, small: &View<'_>) -> Estimator {
    let paths =
        |frame: UVec2| (f64::from(frame.x) * f64::from(frame.y)).min(MAX_LIGHT_PATHS.into());
    let factor = (paths(view.sensor.frame) / paths(small.sensor.frame)).sqrt() as f32;
    let larger = |radius: Radius| Radius {
        first: Some(radius.first(view) * factor),
        ..radius
    };
    match estimator {
        Estimator::Vcm(radius) => Estimator::Vcm(larger(radius)),
        Estimator::VcmNee(radius) => Estimator::VcmNee(larger(radius)),
        Estimator::Sppm(radius) => Estimator::Sppm(larger(radius)),
        other => other,
    }
}
