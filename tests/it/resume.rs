//! Resumed work is bit-identical to work that was never stopped: fifty random places each, at another number of threads
//! after each.

use crate::fuzz::mutate::Rng;
use crate::support::quick_folder;
use crate::support::render::scene;
use opsr::gallery::caustic_box;
use opsr::image::Film;
use opsr::image::film::Window;
use opsr::image::level_film::LevelFilm;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::{FirstHit, Picture, Settings, View};
use opsr::math::UVec2;
use opsr::regularise::{Accumulated, AttenuationTable, Factors, Rule};
use rayon::ThreadPool;

/// Places to stop at.
const PLACES: usize = 50;

/// Ascending places in 1..end, all different.
fn places(name: &str, end: usize) -> Vec<usize> {
    let mut rng = Rng::new(name, 0);
    let mut all: Vec<usize> = (1..end).collect();
    while all.len() > PLACES {
        all.remove(rng.below(all.len()));
    }
    assert_eq!(all.len(), PLACES);
    all
}

/// Pools that take turns.
fn pools() -> Vec<ThreadPool> {
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build();
    [1, 2, 3, 8].map(|n| pool(n).expect("threads")).into()
}

#[test]
fn resume_renders_stopped_at_fifty_places() {
    const SPP: usize = 120;
    let scene = scene(caustic_box());
    let camera = &scene.parts().cameras[0];
    let window = Window {
        x: 3,
        y: 2,
        w: 19,
        h: 17,
    };
    let blank = Picture {
        film: Film::cropped(UVec2::new(24, 20), window).expect("inside"),
        aovs: Some(FirstHit::new(window).into()),
        levels: None,
    };
    let ours = Fingerprint {
        version: "1".into(),
        scene: "box".into(),
        settings: "any".into(),
    };
    let folder = quick_folder();
    let path = folder.path().join("a.ckpt");
    let pools = pools();
    let view = View::of(&scene, camera, &blank.film);
    let consistent = Rule::Accumulated(Accumulated {
        factors: Factors::Table(AttenuationTable::constant(0.3)),
        lambda: 0.2,
    });
    let levels = vec![0.0, 0.5, 1.0];
    for (rule, levels) in [
        (Rule::Plain, Vec::new()),
        (consistent, Vec::new()),
        (Rule::constant(0.3), levels),
    ] {
        let settings = Settings {
            rule,
            levels: levels.clone(),
            seed: 11,
            ..Settings::default()
        };
        let mut integrator = settings.integrator();
        let mut whole = blank.clone();
        integrator.pass(&view, 0..SPP as u32, &mut whole);
        let mut ends = places("render", SPP);
        ends.push(SPP);
        let mut picture = blank.clone();
        picture.levels =
            (!levels.is_empty()).then(|| LevelFilm::new(picture.film.size, window, levels.len()));
        let mut checkpoint = Checkpoint {
            fingerprint: ours.clone(),
            samples: 0,
            seconds: 0.0,
            levels,
            picture,
        };
        for (i, &end) in ends.iter().enumerate() {
            let samples = checkpoint.samples..end as u32;
            let picture = &mut checkpoint.picture;
            pools[i % 4].install(|| integrator.pass(&view, samples, picture));
            checkpoint.samples = end as u32;
            checkpoint.save(&path).expect("saved");
            // Only the content of the file continues.
            checkpoint = Checkpoint::load(&path, &ours).expect("ours");
        }
        assert!(checkpoint.picture == whole, "{:?}", settings.rule);
    }
}

#[cfg(feature = "train")]
mod training {
    use super::*;
    use crate::train::{crop, quick};
    use opsr::train::TrainError;
    use opsr::train::config::{Evaluation, Model, Optimiser};
    use opsr::train::learn::outer_loop::Outcome;
    use opsr::train::record::crop::{Crop, DatasetError};
    use opsr::train::{Config, RecordingControl, Session};
    use std::ops::ControlFlow;
    use std::path::{Path, PathBuf};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::time::Instant;

    /// Trains as a new process would, up to a step.
    fn learn(config: &Config, crop: &Crop, folder: Option<&Path>, stop_at: u32) -> Outcome {
        let crops = vec![crop.clone()];
        let mut session = Session::with_crops(
            config.clone(),
            crops.clone(),
            crops,
            &RecordingControl::default(),
        )
        .expect("a session");
        let mut listen = |step: u32, _: f32, _: Option<&_>| match step == stop_at {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let resume = folder.is_some_and(|f| f.join("last.ckpt").exists());
        session
            .learn(0.001, folder, resume, &mut listen)
            .expect("an outcome")
    }

    #[test]
    fn resume_trainings_stopped_at_fifty_places() {
        let crop = crop(4);
        let pools = pools();
        for (way, model, optimiser) in [
            (Evaluation::Fresh, Model::Full, Optimiser::Adam),
            (Evaluation::Tabulated, Model::Full, Optimiser::Log),
            (Evaluation::Replay, Model::Additive, Optimiser::Log),
        ] {
            let config = Config {
                spp: 8,
                steps: 90,
                model,
                optimiser,
                ..quick(way)
            };
            let whole = learn(&config, &crop, None, u32::MAX);
            let folder = quick_folder();
            let path = Some(folder.path());
            for (i, stop) in places("train", 90).into_iter().enumerate() {
                let part = pools[i % 4].install(|| learn(&config, &crop, path, stop as u32));
                assert_eq!((part.steps, part.stopped), (stop as u32, true), "{way:?}");
            }
            let resumed = learn(&config, &crop, path, u32::MAX);
            assert_eq!(resumed.steps, 90);
            assert_eq!(resumed.table, whole.table, "{way:?}");
            assert_eq!(resumed.best, whole.best, "{way:?}");
        }
    }

    /// The validation at the step where a training is stopped counts once, not before the stop and again after.
    #[test]
    fn resume_counts_the_validation_at_a_stop_once() {
        let crop = crop(4);
        let config = Config {
            spp: 8,
            steps: 60,
            patience: 3,
            // Every step is worse than the start.
            start: 0.03,
            learning_rate: 0.02,
            ..quick(Evaluation::Tabulated)
        };
        let whole = learn(&config, &crop, None, u32::MAX);
        assert!(whole.steps < config.steps, "patience ended nothing");
        assert!(whole.steps > config.validate_every);
        let folder = quick_folder();
        for stop in (0..whole.steps).step_by(config.validate_every as usize) {
            learn(&config, &crop, Some(folder.path()), stop);
        }
        let resumed = learn(&config, &crop, Some(folder.path()), u32::MAX);
        assert_eq!(resumed.steps, whole.steps);
        assert_eq!(resumed.table, whole.table);
        assert_eq!(resumed.best, whole.best);
    }

    /// Opens a session in a folder; `stop` is set when crop number `stop_at` begins.
    fn open(config: &Config, folder: &Path, stop_at: usize) -> Result<Session, TrainError> {
        let (crop, begun) = (crop(4), AtomicUsize::new(0));
        let stop = Arc::new(AtomicBool::new(false));
        let control = RecordingControl {
            folder: Some(folder.into()),
            checkpoints: Vec::new(),
            stop: stop.clone(),
            listen: &|_| {
                if begun.fetch_add(1, Ordering::Relaxed) == stop_at {
                    stop.store(true, Ordering::Relaxed);
                }
            },
        };
        Session::with_crops(config.clone(), vec![crop.clone()], vec![crop], &control)
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
            replicates: 6,
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

        // Settings that recordings do not depend on may change, others not.
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
        // Minutes of work; the stop comes when the second crop begins.
        assert!(open(&config, folder.path(), 1).is_err());
        // With room for a loaded machine.
        assert!(
            clock.elapsed().as_secs_f64() < 10.0,
            "{:?}",
            clock.elapsed()
        );
        assert!(kept(folder.path()).is_empty());
    }
}
