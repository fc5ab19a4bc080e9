//! Random combinations of options on random small scenes: pictures that should be equal are equal.
//!
//! The seed of a trial makes a scene, which is written to a `.glb` file and read, and one of four comparisons. Three
//! are bit-identical: threads, passes and crops with the whole; stopped and resumed with uninterrupted; parts with the
//! whole. The fourth compares the means of two integrators within their noise.

mod scenes;

use super::repeat::{apart, resumed_at};
use super::{Finding, Numbers, pool};
use crate::gallery::glb;
use crate::stats::student;
use crate::verify::modes::{MODES, Mode, Uniform};
use opsr::image::Film;
use opsr::image::film::Window;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::checkpoint::Fingerprint;
use opsr::integrator::part::{self, Part};
use opsr::integrator::{Estimator, Picture, Recorded, Settings, View};
use opsr::math::DVec3;
use opsr::math::moments::Moments;
use opsr::math::{UVec2, luminance};
use opsr::scene::Scene;
use opsr::scene::load::{LoadOptions, load};
use scenes::Kind;
use std::collections::BTreeSet;
use std::error::Error;
use std::ops::{ControlFlow, Range};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Columns and rows of all pictures.
const FRAME: UVec2 = UVec2::new(16, 12);

/// AOVs of all pictures.
const RECORDED: Recorded = Recorded {
    first: true,
    light: true,
    time: false,
};

/// Renders of each of the two integrators whose means are compared.
const SEEDS: u64 = 8;

/// Chance below which a deviation between equal means is tested again with four times the samples; a deviation in all
/// [`ROUNDS`] counts.
const SIGNIFICANCE: f64 = 1e-3;

/// Number of these tests.
const ROUNDS: u32 = 3;

/// Relative difference of means that is accepted, without and with photons: rounding, and the bias of photons.
const TOLERANCE: [f64; 2] = [0.01, 0.1];

/// Result of a trial; the error describes the disagreement.
type Verdict = Result<(), String>;

/// Runs trials from `first` on, until `goes_on` breaks after one. Yields a finding for each disagreement at once, and
/// one for all trials at the end.
pub fn run(
    first: u64,
    mut goes_on: impl FnMut(u64) -> ControlFlow<()>,
) -> impl Iterator<Item = Finding> {
    let (mut tried, mut wrong, mut ended) = (0, 0u32, false);
    let mut said = false;
    std::iter::from_fn(move || {
        while !ended {
            let seed = first + tried;
            let verdict = trial(seed);
            tried += 1;
            ended = goes_on(tried).is_break();
            if let Err(what) = verdict {
                wrong += 1;
                return Some(Finding::new(
                    format!("--seed {seed} --count 1: {what}"),
                    0.0,
                    [1.0],
                ));
            }
        }
        let all = format!("{tried} combinations from seed {first} on: disagreements");
        (!std::mem::replace(&mut said, true)).then(|| Finding::new(all, 0.0, [f64::from(wrong)]))
    })
}

/// One trial; a panic is a disagreement.
pub fn trial(seed: u64) -> Verdict {
    let tried = AssertUnwindSafe(|| one(seed).map_err(|e| e.to_string()));
    catch_unwind(tried).unwrap_or_else(|panic| {
        let text = (panic.downcast_ref::<String>().map(String::as_str))
            .or_else(|| panic.downcast_ref::<&str>().copied());
        Err(format!("panics: {}", text.unwrap_or("without a message")))
    })
}

/// Names of the modes in the trials of these seeds, without rendering them.
pub fn modes(seeds: Range<u64>) -> Result<BTreeSet<&'static str>, Box<dyn Error>> {
    let mut modes = BTreeSet::new();
    for seed in seeds {
        let (scene, comparison, mut numbers) = drawn_scene(seed)?;
        if comparison < 3 {
            modes.insert(settings(&mut numbers, &scene).0.name);
        }
    }
    Ok(modes)
}

/// The scene of a trial, the number of its comparison, and random numbers for its other choices.
fn drawn_scene(seed: u64) -> Result<(Scene, usize, Numbers), Box<dyn Error>> {
    let mut own = Numbers::new(seed);
    let numbers = &mut own;
    let comparison = numbers.below(4);
    let kind = match comparison {
        3 => Kind::Found {
            punctual: numbers.next() < 0.5,
        },
        _ => Kind::Any,
    };
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("scene.glb");
    glb::save(&scenes::scene(numbers, kind), &path)?;
    let mut parts = load(&path, &LoadOptions::default())?.parts;
    scenes::finish(&mut parts, numbers, kind);
    Ok((Scene::new(parts), comparison, own))
}

fn one(seed: u64) -> Result<(), Box<dyn Error>> {
    let (scene, comparison, mut numbers) = drawn_scene(seed)?;
    let numbers = &mut numbers;
    if comparison == 3 {
        return integrators(&scene, numbers);
    }
    let (mode, settings) = settings(numbers, &scene);
    let samples = 1 + numbers.below(12) as u32;
    let differ = match comparison {
        0 => in_pieces(&scene, &settings, samples, numbers),
        1 => stopped(&scene, &settings, samples + 1, numbers)?,
        _ => in_parts(&scene, &settings, samples + 1, numbers)?,
    };
    let what = ["pieces", "resumed", "parts"][comparison];
    match differ {
        0.0 => Ok(()),
        n => {
            let settings = settings.fingerprint();
            Err(format!("{what}: {n} pixels differ: {}: {settings}", mode.name).into())
        }
    }
}

/// A random mode, and settings of it that the scene accepts.
fn settings(numbers: &mut Numbers, scene: &Scene) -> (&'static Mode, Settings) {
    loop {
        let mode = &MODES[numbers.below(MODES.len())];
        let settings = drawn(numbers, mode);
        if settings.check_scene(scene).is_ok() {
            return (mode, settings);
        }
    }
}

fn drawn(numbers: &mut Numbers, mode: &Mode) -> Settings {
    mode.settings(Uniform(&mut || numbers.next()))
}

/// A random window of the frame.
fn window(numbers: &mut Numbers) -> Window {
    let [w, h] = FRAME
        .to_array()
        .map(|n| 1 + numbers.below(n as usize) as u32);
    let [x, y] = [FRAME.x - w, FRAME.y - h].map(|n| numbers.below(n as usize + 1) as u32);
    Window { x, y, w, h }
}

/// A picture of this window, in passes that end at these sample numbers.
fn picture(scene: &Scene, settings: &Settings, window: Window, ends: &[u32]) -> Picture {
    let blank = Picture::blank(FRAME, window, &settings.amounts, RECORDED);
    let mut picture = blank.expect("a window of the frame");
    let mut integrator = settings.integrator();
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    let mut first = 0;
    for &end in ends {
        integrator.pass(&view, first..end, &mut picture);
        first = end;
    }
    picture
}

/// Number of pixels that differ with several threads and passes, and in a crop of such a render.
fn in_pieces(scene: &Scene, settings: &Settings, samples: u32, numbers: &mut Numbers) -> f64 {
    let full = Window::full(FRAME);
    let whole = pool(1).install(|| picture(scene, settings, full, &[samples]));
    let mut ends = numbers.places(samples, 3);
    ends.push(samples);
    let threads = pool(2 + numbers.below(7));
    let pieces = threads.install(|| picture(scene, settings, full, &ends));
    let mut differ = apart(&whole, &pieces);
    // A guide depends on all rendered pixels, so its crop differs.
    if !matches!(settings.estimator, Estimator::Guided { .. }) {
        let window = window(numbers);
        let crop = threads.install(|| picture(scene, settings, window, &ends));
        let cut = whole.film.cut(window);
        let pairs = cut.pixels.iter().zip(&crop.film.pixels);
        differ += pairs.filter(|(a, b)| a != b).count() as f64;
    }
    differ
}

/// Number of pixels that differ after stops at random samples, each with a checkpoint.
fn stopped(
    scene: &Scene,
    settings: &Settings,
    samples: u32,
    numbers: &mut Numbers,
) -> Result<f64, Box<dyn Error>> {
    let blank = Picture::blank(FRAME, Window::full(FRAME), &settings.amounts, RECORDED)?;
    let whole = picture(scene, settings, blank.film.window, &[samples]);
    let mut ends = numbers.places(samples, 3);
    ends.push(samples);
    Ok(apart(&resumed_at(scene, settings, &ends, blank)?, &whole))
}

/// Number of pixels that differ after merging parts of some samples or of some pixels.
fn in_parts(
    scene: &Scene,
    settings: &Settings,
    samples: u32,
    numbers: &mut Numbers,
) -> Result<f64, Box<dyn Error>> {
    if matches!(settings.estimator, Estimator::Guided { .. }) {
        return Ok(0.0);
    }
    let full = Window::full(FRAME);
    let mut pieces = Vec::new();
    if numbers.next() < 0.5 {
        let mut first = 0;
        for end in numbers.places(samples, 2).into_iter().chain([samples]) {
            pieces.push((full, first..end));
            first = end;
        }
    } else {
        let w = 1 + numbers.below(FRAME.x as usize - 1) as u32;
        pieces.push((Window { w, ..full }, 0..samples));
        let rest = Window {
            x: w,
            w: FRAME.x - w,
            ..full
        };
        pieces.push((rest, 0..samples));
    }
    // In a random cyclic order.
    let turn = numbers.below(pieces.len());
    pieces.rotate_left(turn);
    let folder = tempfile::tempdir()?;
    let fingerprint = Fingerprint {
        version: "1".into(),
        scene: "chaos".into(),
        settings: settings.fingerprint(),
    };
    let mut paths = Vec::new();
    for (i, (window, samples)) in pieces.into_iter().enumerate() {
        let view = View::new(scene, &scene.parts().cameras[0], FRAME, window);
        let amounts = settings.amounts.clone();
        let part = Part::new(fingerprint.clone(), &view, samples, amounts, RECORDED);
        let path = folder.path().join(format!("{i}.part"));
        let mut integrator = settings.integrator();
        part.render(&path, &mut *integrator, &view, &mut |_| {
            ControlFlow::Continue(())
        })?;
        paths.push(path);
    }
    let merged = part::merge(&paths, Window::full, Some(samples), true)?;
    let whole = picture(scene, settings, full, &[samples]);
    Ok(apart(&merged.picture, &whole))
}

/// Compares two random plain modes on a scene whose light both find.
fn integrators(scene: &Scene, numbers: &mut Numbers) -> Result<(), Box<dyn Error>> {
    let max_vertices = 2 + numbers.below(5) as u32;
    let roulette_start = 2 + numbers.below(6) as u32;
    let mut next = || loop {
        let mode = &MODES[numbers.below(MODES.len())];
        let settings = drawn(numbers, mode);
        let estimator = match settings.estimator {
            Estimator::Mlt { .. } => Estimator::Mlt { mutations: 16 },
            Estimator::Vcm(_) => Estimator::Vcm(Radius::default()),
            Estimator::VcmNee(_) => Estimator::VcmNee(Radius::default()),
            Estimator::Sppm(_) => Estimator::Sppm(Radius::default()),
            other => other,
        };
        let settings = Settings {
            estimator,
            max_vertices,
            roulette_start,
            ..settings
        };
        if mode.is_plain && settings.check_scene(scene).is_ok() {
            return settings;
        }
    };
    let pair = [next(), next()];
    Ok(agree(scene, &pair)?)
}

/// An error if the means of two settings differ by more than their noise, in the whole picture or a quarter of it.
pub fn agree(scene: &Scene, pair: &[Settings; 2]) -> Verdict {
    let photons = |s: &Settings| {
        matches!(
            s.estimator,
            Estimator::Vcm(_) | Estimator::VcmNee(_) | Estimator::Sppm(_)
        )
    };
    let tolerance = TOLERANCE[usize::from(pair.iter().any(photons))];
    let mut what = String::new();
    for round in 0..ROUNDS {
        let [a, b] = [0, 1].map(|k| means(scene, &pair[k], round, k as u64));
        let differ = a.iter().zip(&b).enumerate().find_map(|(place, (a, b))| {
            let (x, y) = (a.mean.x, b.mean.x);
            let [va, vb] = [a, b].map(|m| m.variance_of_mean().x);
            let apart = (x - y).abs() - tolerance * x.max(y);
            let degrees = f64::from(SEEDS as u32 - 1);
            let p = student::two_sided(apart.max(0.0) / (va + vb).sqrt(), degrees);
            (apart > 0.0 && p < SIGNIFICANCE).then(|| {
                let place = ["all", "a quarter", "a quarter", "a quarter", "a quarter"][place];
                let [va, vb] = [va, vb].map(f64::sqrt);
                format!("{place}: {x:.5} ± {va:.5} and {y:.5} ± {vb:.5}")
            })
        });
        match differ {
            None => return Ok(()),
            Some(differ) => what = differ,
        }
    }
    let [a, b] = pair.each_ref().map(|s| format!("{:?}", s.estimator));
    Err(format!(
        "{a} against {b}, {} vertices, {what}",
        pair[0].max_vertices
    ))
}

/// Mean luminance of the picture and of its quarters, over seeds, so that its error includes shared light paths.
fn means(scene: &Scene, settings: &Settings, round: u32, side: u64) -> [Moments; 5] {
    let samples = 16 << (2 * round);
    let mut means = [Moments::default(); 5];
    for seed in 0..SEEDS {
        let settings = Settings {
            seed: 1 + seed + SEEDS * (2 * u64::from(round) + side),
            ..settings.clone()
        };
        let film = picture(scene, &settings, Window::full(FRAME), &[samples]).film;
        for (place, value) in places(&film).into_iter().enumerate() {
            means[place].push(DVec3::splat(value));
        }
    }
    means
}

/// Mean luminance of a picture and of its quarters.
fn places(film: &Film) -> [f64; 5] {
    let mut sums = [0.0; 5];
    let mean = film.mean();
    for (i, pixel) in mean.pixels.iter().enumerate() {
        let (x, y) = (i as u32 % FRAME.x, i as u32 / FRAME.x);
        let quarter = 1 + u32::from(2 * x >= FRAME.x) + 2 * u32::from(2 * y >= FRAME.y);
        let value = f64::from(luminance(*pixel)) / mean.pixels.len() as f64;
        sums[0] += value;
        sums[quarter as usize] += 4.0 * value;
    }
    sums
}
