//! An evaluation of the loss without a recording: every call traces new paths with the table of the step. It is slow,
//! and the reference for the other evaluations.

use super::crop;
use opsr::regularise::{AttenuationTable, LEN, Lookup, Rule};
use opsr::sampler::{Domain, Seed};
use opsr_lab::verify::learning::{adjoint, quick, uneven};
use opsr_train::evaluate::curves::Curves;
use opsr_train::evaluate::replay::Replay;
use opsr_train::evaluate::{Adjoint, MomentSource, Moments};
use opsr_train::record::crop::Crop;
use opsr_train::record::visits::Visits;
use opsr_train::{Config, RecordingControl, Session};
use std::ops::ControlFlow;

/// Traces new paths at every call.
struct Fresh {
    crop: Crop,
    spp: u32,
    seed: Seed,
    /// Number of calls of [`MomentSource::moments`].
    traced: u64,
    last: Option<Replay>,
}

impl Fresh {
    /// A crop with `spp` samples per pixel; the seed of every call follows from `seed`.
    fn new(crop: Crop, spp: u32, seed: Seed) -> Self {
        Self {
            crop,
            spp,
            seed,
            traced: 0,
            last: None,
        }
    }

    /// Paths of a numbered call.
    fn trace(&self, table: &AttenuationTable, number: u64) -> Replay {
        let rule = Rule::with_table(table.clone());
        // The recording of a training uses number 0.
        let seed = self.seed.derive(Domain::Recording, 1 + number);
        let recording = self.crop.record_with(rule, self.spp, seed);
        Replay::new(recording.expect("a recording"))
    }
}

impl MomentSource for Fresh {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        self.traced += 1;
        let replay = self.trace(table, self.traced);
        self.last.insert(replay).moments(table)
    }

    /// Always with the paths of call 0.
    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        self.trace(table, 0).moments(table)
    }

    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let last = self.last.as_ref().expect("moments before the gradient");
        last.gradient(table, adjoint)
    }
}

/// Mean of numbers, and its standard error.
fn mean(numbers: &[f64]) -> (f64, f64) {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    let square: f64 = numbers.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, (square / (n * (n - 1.0))).sqrt())
}

/// Gradients of recordings at a few constant factors have the mean of those of paths traced with the table itself, per
/// path length.
#[test]
fn gradients_of_recordings_agree_with_fresh_paths() {
    const CALLS: u64 = 48;
    const SPP: u32 = 64;
    let crop = crop(6);
    let config = Config::default();
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        let (table, adjoint) = (uneven(lookup), adjoint(crop.window.len()));
        // Sums of γ dL/dγ.
        let sums = |source: &mut dyn MomentSource| -> Vec<f64> {
            source.moments(&table);
            let gradient = source.gradient(&table, &adjoint);
            let parts = (0..LEN).map(|i| gradient[i] * f64::from(table.gammas[i]));
            let parts: Vec<f64> = parts.collect();
            let lengths = [0..16, 16..80, 80..336, 336..LEN];
            lengths.map(|range| parts[range].iter().sum()).to_vec()
        };
        let mut found = [Vec::new(), Vec::new(), Vec::new()];
        let mut fresh = Fresh::new(crop.clone(), SPP, Seed(3));
        for call in 0..CALLS {
            let recording =
                (crop.record(&config.record_gammas, 0.3, SPP, Seed(1000 + call))).unwrap();
            found[1].push(sums(&mut Curves::bake(&recording, &table)));
            found[2].push(sums(&mut Replay::new(recording)));
            found[0].push(sums(&mut fresh));
        }
        let parts = found[0][0].len();
        for part in 0..parts {
            let of = |source: &[Vec<f64>]| -> (f64, f64) {
                let numbers: Vec<f64> = source.iter().map(|sums| sums[part]).collect();
                mean(&numbers)
            };
            let (expected, error) = of(&found[0]);
            assert!(error > 0.0, "{lookup:?}: part {part} has no events");
            for source in &found[1..] {
                let (mean, own) = of(source);
                let z = (mean - expected) / error.hypot(own);
                assert!(
                    z.abs() < 4.5,
                    "{lookup:?}, part {part}: {mean} for {expected}, z {z}"
                );
            }
        }
    }
}

/// Adam lowers the loss of fresh paths as it does that of a recording.
#[test]
fn learning_from_fresh_paths_lowers_the_loss() {
    let crop = crop(6);
    let config = Config {
        spp: 128,
        steps: 40,
        optimiser: opsr_train::config::Optimiser::Log,
        learning_rate: 0.08,
        ..quick(Default::default())
    };
    let crops = vec![crop.clone()];
    let control = RecordingControl::default();
    let mut session = Session::with_crops(config, crops.clone(), crops, &control).unwrap();
    session.training.remove(|_| true);
    let target = crop.target(128);
    let source = Box::new(Fresh::new(crop.clone(), 128, Seed(0)));
    (session.training).push(crop, source, target, Visits::default());
    let listen: &mut dyn FnMut(u32, f32, Option<&_>) -> ControlFlow<()> =
        &mut |_, _, _| ControlFlow::Continue(());
    let outcome = session.learn(0.0001, None, false, listen).unwrap();
    let loss = |i: usize| outcome.log[i].validation.unwrap();
    let last = outcome.log.len() - 1;
    assert!(loss(last) < 0.99 * loss(0), "{} of {}", loss(last), loss(0));
}
