//! Fuzz targets of the trainer: configurations, training checkpoints, recordings.

use super::targets::{text, written};
use super::{Target, repair};
use opsr::regularise::{AttenuationTable, LEN, Lookup};
use opsr::sampler::Seed;
use opsr_train::Config;
use opsr_train::config::Optimiser;
use opsr_train::evaluate::MomentSource;
use opsr_train::evaluate::curves::Curves;
use opsr_train::evaluate::replay::Replay;
use opsr_train::learn::checkpoint::Checkpoint;
use opsr_train::learn::model::Learner;
use opsr_train::record::recording::Recording;

/// Configurations: an accepted one survives a round trip.
pub(crate) fn configurations() -> Target {
    let all = Config::default().to_toml().expect("TOML");
    let some = "optimiser = \"log\"\nscenes = [\"a\"]\nbeta = [0.1, 1]\nstart = 0.0\n";
    Target {
        name: "configurations",
        file_name: "fuzz-config.toml",
        seeds: vec![all.into(), some.into()],
        repair: repair::nothing,
        read: |path| {
            let config = text(Config::default().with_file(path))?;
            let place = |e: String| format!("{}: {e}", path.display());
            text(config.check()).map_err(place)?;
            let written = config.to_toml().expect("TOML");
            let again = Config::default().with_text(&written, "again");
            assert_eq!(again.expect("valid TOML"), config);
            let Config {
                method,
                optimiser,
                lookup,
                ..
            } = config;
            Ok(format!("{method:?} {optimiser:?} {lookup:?}"))
        },
    }
}

fn learner() -> Learner {
    Learner::new(Optimiser::Log, 0.05, Lookup::Nearest, 0.5)
}

/// A learner with a constant parameter id. burn writes the id into its states and draws it at random, so seeds made by
/// other learners, and with them all executions, would differ from run to run.
fn reproducible_learner() -> Learner {
    let mut state = learner().to_bytes().expect("a state");
    // CBOR: the name, then the id as an integer of eight bytes.
    let name = b"param_id\x1b";
    let at = state.parameters.windows(name.len()).position(|w| w == name);
    let at = at.expect("an id") + name.len();
    state.parameters[at..at + 8].fill(1);
    learner().restore(state).expect("a state")
}

/// Fingerprint of the training that wrote the seeds.
const FINGERPRINT: &str = "00ff";

/// Training checkpoints: an accepted one is resumed for one step.
pub(crate) fn trainings() -> Target {
    let seeds = [false, true].map(|best| {
        let mut learner = reproducible_learner();
        let gradient: Vec<f64> = (0..LEN).map(|i| (i % 7) as f64 - 3.0).collect();
        learner.step(&gradient);
        let checkpoint = Checkpoint {
            fingerprint: FINGERPRINT.into(),
            step: 1,
            best: best.then(|| (1, 0.25, AttenuationTable::constant(0.5))),
            anchor: AttenuationTable::constant(0.25),
            state: learner.to_bytes().expect("a state"),
        };
        written(|path| text(checkpoint.save(path)))
    });
    Target {
        name: "trainings",
        file_name: "fuzz-last.ckpt",
        seeds: seeds.into(),
        repair: repair::sealed,
        read: |path| {
            let checkpoint = text(Checkpoint::load(path, FINGERPRINT))?;
            let mut learner = text(checkpoint.restore(learner(), path))?;
            learner.step(&vec![1e-3; LEN]);
            let mut gammas = learner.table().gammas.into_iter();
            assert!(gammas.all(|g| (0.0..=1.0).contains(&g)));
            let best = checkpoint.best.is_some();
            Ok(format!("best {best}"))
        },
    }
}

/// Recordings: an accepted one is replayed and baked. One pixel has the shortest files.
pub(crate) fn recordings() -> Target {
    let seeds = [1, 8].map(|spp| {
        let recording = crate::train::crop(1).record(&[0.05, 0.5], 0.0, spp, Seed(3));
        let recording = recording.expect("a recording");
        written(|path| text(recording.save(path, FINGERPRINT)))
    });
    Target {
        name: "recordings",
        file_name: "fuzz.recording",
        seeds: seeds.into(),
        repair: repair::sealed,
        read: |path| {
            let recording = text(Recording::load(path, FINGERPRINT, 1))?;
            let table = AttenuationTable::constant(0.1);
            let baked = Curves::bake(&recording, &table).exact(&table);
            assert_eq!(baked.mean.len(), 1);
            let events = !recording.events.is_empty();
            Replay::new(recording).moments(&table);
            Ok(format!("events {events}"))
        },
    }
}
