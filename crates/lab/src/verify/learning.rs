//! The trainer: gradients against finite differences, tables that do not depend on threads and stops, falling losses.

use super::{Finding, Numbers, Size};
use crate::gallery::caustic_box;
use opsr::image::film::Window;
use opsr::math::UVec2;
use opsr::regularise::{AttenuationTable, LEN, Lookup};
use opsr::sampler::Seed;
use opsr::scene::{Scene, SceneParts};
use opsr_train::config::{Evaluation, Optimiser};
use opsr_train::evaluate::replay::Replay;
use opsr_train::evaluate::{Adjoint, MomentSource, Moments};
use opsr_train::learn::outer_loop::Outcome;
use opsr_train::manifest::Role;
use opsr_train::record::crop::{Crop, DatasetError};
use opsr_train::{Config, RecordingControl, Session, TrainError};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// Factor with which the references of [`crop_of`] are rendered.
pub const TRUTH: f32 = 0.03;

/// A small crop of a scene with a slightly roughened reference, so that the factor [`TRUTH`] is the best.
pub fn crop_of(parts: SceneParts, edge: u32) -> Result<Crop, DatasetError> {
    let scene = Scene::new(parts);
    let camera = scene.parts().cameras[0].clone();
    let mut crop = Crop {
        name: "box".into(),
        scene_name: "box".into(),
        family: "box".into(),
        role: Role::Train,
        scene: Arc::new(scene),
        digest: [0; 32],
        camera,
        frame: UVec2::splat(64),
        window: Window {
            x: 40,
            y: 56,
            w: edge,
            h: edge,
        },
        max_vertices: 10,
        reference: Vec::new(),
        reference_noise: 0.0,
    };
    let recording = crop.record(&[TRUTH], 0.0, 1024, Seed(99))?;
    let truth = AttenuationTable::constant(TRUTH);
    crop.reference = Replay::new(recording).moments(&truth).mean;
    Ok(crop)
}

/// Settings of a training that takes a second.
pub fn quick(method: Evaluation) -> Config {
    Config {
        spp: 32,
        steps: 12,
        method,
        learning_rate: 0.02,
        validate_every: 4,
        checkpoint_every: 5,
        ..Config::default()
    }
}

/// A table whose factors differ between classes and stay away from the bounds.
pub fn uneven(lookup: Lookup) -> AttenuationTable {
    let mut table = AttenuationTable::constant(0.0);
    for (i, gamma) in table.gammas.iter_mut().enumerate() {
        *gamma = 0.05 + 0.4 * ((i * 37 % 101) as f32 / 101.0);
    }
    table.lookup = lookup;
    table
}

/// An arbitrary derivative of a loss with respect to the moments.
pub fn adjoint(pixels: usize) -> Adjoint {
    Adjoint {
        mean: (0..pixels)
            .map(|p| [0.3 + 0.1 * (p % 3) as f32, -0.2, 0.1])
            .collect(),
        second: (0..pixels).map(|p| 0.05 + 0.01 * (p % 5) as f32).collect(),
    }
}

/// A linear loss of the moments with this derivative.
fn weigh(adjoint: &Adjoint, moments: &Moments) -> f64 {
    let (mean, found) = (adjoint.mean.iter().flatten(), moments.mean.iter().flatten());
    let second = adjoint.second.iter().zip(&moments.second);
    let product = |(a, m): (&f32, &f32)| f64::from(*a) * f64::from(*m);
    mean.zip(found).chain(second).map(product).sum()
}

/// Gradients of `recordings` replayed recordings with respect to the factors, scaled by `factor`, against central
/// differences: median relative error over the six strongest classes of each.
pub fn derivatives(crop: &Crop, recordings: u64, factor: f64) -> Result<Finding, DatasetError> {
    let mut errors = Vec::new();
    let lookups = [Lookup::Nearest, Lookup::Linear];
    for (seed, lookup) in (0..recordings).flat_map(|seed| lookups.map(|lookup| (seed, lookup))) {
        let gammas = Config::default().record_gammas;
        let mut replay = Replay::new(crop.record(&gammas, 0.3, 96, Seed(5 + seed))?);
        let (table, adjoint) = (uneven(lookup), adjoint(crop.window.len()));
        replay.moments(&table);
        let gradient = replay.gradient(&table, &adjoint);
        let mut strongest: Vec<usize> = (0..LEN).collect();
        strongest.sort_by(|&a, &b| gradient[b].abs().total_cmp(&gradient[a].abs()));
        for &class in &strongest[..6] {
            let mut at = |step: f32| {
                let mut moved = table.clone();
                moved.gammas[class] += step;
                weigh(&adjoint, &replay.moments(&moved))
            };
            // The gradient takes a folded value's bin as constant. A step may cross an edge, hence the median.
            let h = 2e-4;
            let difference = (at(h) - at(-h)) / (2.0 * f64::from(h));
            errors.push((difference / (factor * gradient[class]) - 1.0).abs());
        }
    }
    errors.sort_by(f64::total_cmp);
    Ok(Finding::new(
        format!(
            "gradients against central differences, median of {}",
            errors.len()
        ),
        0.02,
        errors.get(errors.len() / 2).copied(),
    ))
}

/// Trains on a crop up to a step, as a new process would.
pub fn learn(
    config: &Config,
    crop: &Crop,
    folder: Option<&Path>,
    stop_at: u32,
) -> Result<Outcome, TrainError> {
    let crops = vec![crop.clone()];
    let control = RecordingControl::default();
    let mut session = Session::with_crops(config.clone(), crops.clone(), crops, &control)?;
    let mut listen = |step: u32, _: f32, _: Option<&_>| match step == stop_at {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let resume = folder.is_some_and(|f| f.join("last.ckpt").exists());
    session.learn(config.beta[0], folder, resume, &mut listen)
}

/// Number of factors of two tables that are not bit-identical.
fn apart(a: &AttenuationTable, b: &AttenuationTable) -> f64 {
    let pairs = a.gammas.iter().zip(b.gammas.iter());
    pairs.filter(|(a, b)| a.to_bits() != b.to_bits()).count() as f64
}

const METHODS: [Evaluation; 2] = [Evaluation::Replay, Evaluation::Tabulated];

/// Compares tables at 2, 3 and 8 threads with the table of one thread.
pub fn threads(crop: &Crop) -> Result<Finding, TrainError> {
    let mut differ = Vec::new();
    for method in METHODS {
        let table = |threads| {
            let pool = super::pool(threads);
            pool.install(|| learn(&quick(method), crop, None, u32::MAX))
                .map(|o| o.table)
        };
        let one = table(1)?;
        for threads in [2, 3, 8] {
            differ.push(apart(&one, &table(threads)?));
        }
    }
    let tried = "factors of tables that differ by the number of threads";
    Ok(Finding::new(tried, 0.0, differ))
}

/// Compares tables of uninterrupted trainings with those that stop at `stops` steps, each time resumed from the
/// checkpoint at another number of threads.
pub fn resumed(crop: &Crop, stops: usize) -> Result<Finding, Box<dyn Error>> {
    let mut differ = Vec::new();
    for (method, optimiser) in [
        (Evaluation::Tabulated, Optimiser::Log),
        (Evaluation::Replay, Optimiser::Adam),
    ] {
        let steps = 2 * stops as u32;
        let config = Config {
            spp: 8,
            steps,
            optimiser,
            ..quick(method)
        };
        let whole = learn(&config, crop, None, u32::MAX)?;
        let folder = tempfile::tempdir()?;
        for (i, &end) in Numbers::new(61).places(steps, stops).iter().enumerate() {
            let part = super::pool([1, 2, 3, 8][i % 4])
                .install(|| learn(&config, crop, Some(folder.path()), end))?;
            // A training that did not stop at this step was not resumed either.
            differ.push(f64::from(u8::from(part.steps != end || !part.stopped)));
        }
        let end = learn(&config, crop, Some(folder.path()), u32::MAX)?;
        differ.push(apart(&end.table, &whole.table));
        differ.push(f64::from(u8::from(end.best != whole.best)));
    }
    let tried = format!("factors of tables that differ after {stops} stops");
    Ok(Finding::new(tried, 0.0, differ))
}

/// Ratios of the validation losses after a training to those before it.
pub fn losses(crop: &Crop, steps: u32) -> Result<Finding, TrainError> {
    let mut ratios = Vec::new();
    for method in METHODS {
        let config = Config {
            spp: 128,
            steps,
            optimiser: Optimiser::Log,
            learning_rate: 0.08,
            beta: vec![0.0001],
            ..quick(method)
        };
        let outcome = learn(&config, crop, None, u32::MAX)?;
        let loss = |entry: Option<&opsr_train::learn::outer_loop::LogEntry>| {
            entry
                .and_then(|entry| entry.validation)
                .map_or(f64::NAN, f64::from)
        };
        ratios.push(loss(outcome.log.last()) / loss(outcome.log.first()));
    }
    let tried = format!("loss after {steps} steps over the loss before");
    Ok(Finding::new(tried, 0.99, ratios))
}

/// All checks of the trainer.
pub fn all(size: Size) -> Vec<Finding> {
    let checks = || -> Result<Vec<Finding>, Box<dyn Error>> {
        let crop = crop_of(caustic_box(), size.of(4, 6, 8))?;
        Ok(vec![
            derivatives(&crop, size.of(1, 4, 100), 1.0)?,
            threads(&crop)?,
            resumed(&crop, size.of(3, 10, 200))?,
            losses(&crop, size.of(40, 40, 400))?,
        ])
    };
    checks().unwrap_or_else(|error| vec![Finding::failed(error)])
}
