//! Resumed work is bit-identical to uninterrupted work: fifty random stops each, with another number of threads after
//! each.

use crate::support::holds;
use opsr_lab::verify::{Size, repeat};

#[test]
fn resume_renders_stopped_at_fifty_places() {
    holds(repeat::resume(Size::Small));
}

#[cfg(feature = "train")]
mod training {
    use crate::support::quick_folder;
    use crate::train::crop;
    use opsr_lab::verify::learning::{self, quick};
    use opsr_train::TrainError;
    use opsr_train::config::{Evaluation, Optimiser};
    use opsr_train::learn::outer_loop::Outcome;
    use opsr_train::record::crop::{Crop, DatasetError};
    use opsr_train::{Config, RecordingControl, Session};
    use std::ops::ControlFlow;
    use std::path::{Path, PathBuf};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::time::Instant;

    /// Trains up to a step, as a new process would.
    fn learn(config: &Config, crop: &Crop, folder: Option<&Path>, stop_at: u32) -> Outcome {
        learning::learn(config, crop, folder, stop_at).expect("an outcome")
    }

    #[test]
    fn resume_trainings_stopped_at_fifty_places() {
        let finding = learning::resumed(&crop(4), 50).expect("trainings");
        assert!(finding.holds(), "{finding:?}");
    }

    /// A training that is stopped at each validation ends like an uninterrupted one.
    #[test]
    fn resume_of_a_training_stopped_at_its_validations() {
        let crop = crop(4);
        let config = Config {
            spp: 8,
            steps: 24,
            // Every step is worse than the start.
            start: 0.03,
            learning_rate: 0.02,
            ..quick(Evaluation::Tabulated)
        };
        let whole = learn(&config, &crop, None, u32::MAX);
        assert!(whole.steps > config.validate_every);
        let folder = quick_folder();
        for stop in (0..whole.steps).step_by(config.validate_every as usize) {
            learn(&config, &crop, Some(folder.path()), stop);
        }
        let resumed = learn(&config, &crop, Some(folder.path()), u32::MAX);
        assert_eq!(resumed.table, whole.table);
        assert_eq!(resumed.best, whole.best);
    }

    /// Opens a session in a folder; `stop` is set when crop number `stop_at` begins.
    fn open(config: &Config, folder: &Path, stop_at: usize) -> Result<Session, TrainError> {
        let (crop, begun) = (crop(4), AtomicUsize::new(0));
        let stop = Arc::new(AtomicBool::new(false));
        let control = RecordingControl {
            folder: Some(folder.into()),
            stop: stop.clone(),
            listen: &|_| {
                if begun.fetch_add(1, Ordering::Relaxed) == stop_at {
                    stop.store(true, Ordering::Relaxed);
                }
            },
            ..RecordingControl::default()
        };
        Session::with_crops(config.clone(), vec![crop.clone(); 6], vec![crop], &control)
    }

    fn kept(folder: &Path) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).expect("a folder");
        let mut paths: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
        paths.sort();
        paths
    }

    #[test]
    fn resume_of_stopped_recordings_gives_the_same_table() {
        let config = Config {
            spp: 8,
            steps: 9,
            ..quick(Evaluation::Tabulated)
        };
        let table = |session: &mut Session| {
            let listen: &mut dyn FnMut(u32, f32, Option<&_>) -> ControlFlow<()> =
                &mut |_, _, _| ControlFlow::Continue(());
            session
                .learn(0.001, None, false, listen)
                .expect("a table")
                .table
        };
        let (whole, parts) = (quick_folder(), quick_folder());
        let expected = table(&mut open(&config, whole.path(), usize::MAX).expect("a session"));
        assert_eq!(kept(whole.path()).len(), 7);
        for stop_at in [0, 2, 3] {
            let ended = open(&config, parts.path(), stop_at).err();
            let stopped = matches!(ended, Some(TrainError::Dataset(DatasetError::Stopped)));
            assert!(stopped, "{stop_at}: {ended:?}");
        }
        let before = kept(parts.path());
        assert!((2..7).contains(&before.len()), "{before:?}");
        let mut resumed = open(&config, parts.path(), usize::MAX).expect("a session");
        assert_eq!(table(&mut resumed), expected);
        for (a, b) in kept(whole.path()).iter().zip(kept(parts.path())) {
            assert_eq!(a.file_name(), b.file_name());
            assert!(std::fs::read(a).unwrap() == std::fs::read(&b).unwrap());
        }

        // Settings without influence on recordings may change, others not.
        let other = Config {
            steps: 3,
            optimiser: Optimiser::Log,
            beta: vec![0.1],
            ..config.clone()
        };
        open(&other, parts.path(), usize::MAX).expect("a session");
        let refused = |config: Config, words: &str| {
            let error = open(&config, parts.path(), usize::MAX).err().expect(words);
            let text = error.to_string();
            assert!(
                text.contains("000-box.recording: ") && text.contains(words),
                "{text}"
            );
        };
        let base = &config;
        for other in [
            Config {
                seed: 1,
                ..base.clone()
            },
            Config {
                spp: 9,
                ..base.clone()
            },
            Config {
                roulette: 0.2,
                ..base.clone()
            },
            Config {
                record_gammas: vec![0.1],
                ..base.clone()
            },
        ] {
            refused(other, "other settings");
        }
        let first = &kept(parts.path())[0];
        let mut bytes = std::fs::read(first).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(first, bytes).unwrap();
        refused(config.clone(), "a damaged recording");
    }

    #[test]
    fn resume_needs_no_wait_since_a_stop_ends_a_recording_within_a_second() {
        let config = Config {
            spp: 1 << 20,
            ..quick(Evaluation::Tabulated)
        };
        let folder = quick_folder();
        let clock = Instant::now();
        // Minutes of work; the stop comes at the second crop.
        assert!(open(&config, folder.path(), 1).is_err());
        // Generous, for a loaded machine.
        assert!(
            clock.elapsed().as_secs_f64() < 10.0,
            "{:?}",
            clock.elapsed()
        );
        assert!(kept(folder.path()).is_empty());
    }
}
