//! Complete trainings of a second: learning, determinism, resumption.

use super::crop;
use crate::support::root;
use opsr::regularise::AttenuationTable;
use opsr::sampler::{Domain, Seed};
use opsr_lab::verify::learning::{self, TRUTH, quick};
use opsr_train::config::{Evaluation, Optimiser, Preset};
use opsr_train::evaluate::MomentSource;
use opsr_train::evaluate::replay::Replay;
use opsr_train::learn::outer_loop::Outcome;
use opsr_train::{Config, RecordingControl, Session};
use std::ops::ControlFlow;
use std::path::Path;

pub(super) fn learn(
    config: Config,
    folder: Option<&std::path::Path>,
    resume: bool,
    stop_at: u32,
) -> Outcome {
    let beta = config.beta[0];
    let mut session = Session::with_crops(
        config,
        vec![crop(6)],
        vec![crop(6)],
        &RecordingControl::default(),
    )
    .unwrap();
    session
        .learn(beta, folder, resume, &mut |step, _, _| {
            if step == stop_at {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .unwrap()
}

#[test]
fn learning_lowers_the_loss_with_every_evaluation() {
    let finding = learning::losses(&crop(6), 40).unwrap();
    assert!(finding.holds(), "{finding:?}");
}

#[test]
fn determinism_of_tables_at_any_thread_count() {
    let finding = learning::threads(&crop(6)).unwrap();
    assert!(finding.holds(), "{finding:?}");
}

#[test]
fn resume_gives_bit_identical_tables() {
    // From a given factor, and from the best constant, which a resumed training searches again.
    for (method, start) in [
        (Evaluation::Replay, 0.5),
        (Evaluation::Tabulated, 0.5),
        (Evaluation::Replay, 0.0),
    ] {
        let config = || Config {
            start,
            ..quick(method)
        };
        let whole = learn(config(), None, false, u32::MAX);
        let folder = tempfile::tempdir().unwrap();
        let stopped = learn(config(), Some(folder.path()), false, 7);
        assert!(stopped.stopped && stopped.steps == 7);
        let resumed = learn(config(), Some(folder.path()), true, u32::MAX);
        assert_eq!(resumed.table, whole.table, "{method:?} {start}");
        assert_eq!(resumed.best, whole.best, "{method:?} {start}");
        // Other settings are refused.
        let other = Config {
            seed: 1,
            ..quick(method)
        };
        let mut session =
            Session::with_crops(other, vec![crop(6)], vec![], &RecordingControl::default())
                .unwrap();
        let refused = session.learn(0.001, Some(folder.path()), true, &mut |_, _, _| {
            ControlFlow::Continue(())
        });
        assert!(refused.is_err_and(|e| e.to_string().contains("other settings")));
    }
}

/// The best constant for the second β is independent of the search for the first.
#[test]
fn determinism_of_a_beta_alone_and_after_another() {
    for method in [Evaluation::Replay, Evaluation::Tabulated] {
        let config = Config {
            start: 0.0,
            steps: 4,
            ..quick(method)
        };
        let learn = |betas: &[f32]| {
            let crops = (vec![crop(6)], vec![crop(6)]);
            let mut session = Session::with_crops(
                config.clone(),
                crops.0,
                crops.1,
                &RecordingControl::default(),
            )
            .unwrap();
            let continue_ = &mut |_, _, _: Option<&_>| ControlFlow::Continue(());
            let outcomes = betas
                .iter()
                .map(|&b| session.learn(b, None, false, continue_));
            outcomes.last().unwrap().unwrap()
        };
        let (alone, after) = (learn(&[0.05]), learn(&[0.001, 0.05]));
        assert_eq!(alone.start, after.start, "{method:?}");
        assert_eq!(alone.table, after.table, "{method:?}");
    }
}

/// A short training on a shipped scene gives the very table that it gave at the time of those in `params/`. If it
/// differs, they are outdated: train them again, and store the new table here.
#[test]
fn shipped_tables_are_those_of_this_program() {
    let config = Config {
        spp: 8,
        steps: 12,
        manifest: root().join("training_scenes/manifest.toml"),
        ..Config::from(Preset::Smoke)
    };
    let mut session = Session::open(config, &RecordingControl::default()).unwrap();
    let learned = session
        .learn(0.001, None, false, &mut |_, _, _| ControlFlow::Continue(()))
        .unwrap();
    let known = root().join("tests/data/small_table.json");
    let text = std::fs::read_to_string(&known).unwrap_or_default();
    let factors: Vec<f32> = serde_json::from_str(&text).unwrap_or_default();
    if factors != learned.table.gammas.as_slice() {
        let new = Path::new(env!("CARGO_TARGET_TMPDIR")).join("small_table.json");
        let text = serde_json::to_string(learned.table.gammas.as_slice()).unwrap();
        std::fs::write(&new, text + "\n").unwrap();
        let differ = (factors.iter().zip(learned.table.gammas.iter())).filter(|(a, b)| a != b);
        panic!(
            "{} factors differ from those of {}. Learn the tables of params/ anew (docs/training.md), and copy {} there.",
            differ.count(),
            known.display(),
            new.display()
        );
    }
}

#[test]
fn learning_recovers_a_known_factor() {
    let mut exact = crop(6);
    exact.reference = Vec::new();
    let config = Config {
        spp: 256,
        steps: 400,
        method: Evaluation::Replay,
        optimiser: Optimiser::Log,
        learning_rate: 0.01,
        start: 2.0 * TRUTH,
        validate_every: 400,
        record_gammas: vec![TRUTH],
        roulette: 0.0,
        beta: vec![0.0],
        ..Config::default()
    };
    let truth = AttenuationTable::constant(TRUTH);
    // The same paths as the session records, so that the loss can reach 0.
    let seed = Seed(config.seed).derive(Domain::Recording, 0);
    let recording = exact.record(&[TRUTH], 0.0, config.spp, seed).unwrap();
    exact.reference = Replay::new(recording).moments(&truth).mean;
    let mut session =
        Session::with_crops(config, vec![exact], vec![], &RecordingControl::default()).unwrap();
    let outcome = session
        .learn(0.0, None, false, &mut |_, _, _| ControlFlow::Continue(()))
        .unwrap();
    let last = outcome.log.last().unwrap().loss;
    assert!(
        last < 0.1 * outcome.log[0].loss,
        "{last} of {}",
        outcome.log[0].loss
    );
    // Weighted by events per class: a rare class hardly changes its pixels and may keep its start.
    let (mut sum, mut visits) = (0.0, 0.0);
    for (gamma, &n) in outcome
        .table
        .gammas
        .iter()
        .zip(session.training.visits().0.iter())
    {
        sum += n as f64 * f64::from((gamma / TRUTH).ln().abs());
        visits += n as f64;
    }
    assert!(sum / visits < 0.1, "{}", sum / visits);
}
