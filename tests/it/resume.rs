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
    use opsr::train::config::{Evaluation, Model, Optimiser};
    use opsr::train::learn::outer_loop::Outcome;
    use opsr::train::record::crop::Crop;
    use opsr::train::{Config, Session};
    use std::ops::ControlFlow;
    use std::path::Path;

    /// Trains as a new process would, up to a step.
    fn learn(config: &Config, crop: &Crop, folder: Option<&Path>, stop_at: u32) -> Outcome {
        let crops = vec![crop.clone()];
        let mut session =
            Session::with_crops(config.clone(), crops.clone(), crops, &|_| ()).expect("a session");
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
}
