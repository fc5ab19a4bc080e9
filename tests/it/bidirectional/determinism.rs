//! Bytes at any number of threads, in any split into passes, after a resume, and of a crop.

use super::scenes::with_sphere;
use crate::support::quick_folder;
use crate::support::render::scene;
use opsr::gallery::materials::{coated, diffuse};
use opsr::image::Film;
use opsr::image::film::Window;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::{Estimator, FirstHit, Picture, Settings, View};
use opsr::math::{Rgb, UVec2};
use opsr::regularise::Rule;
use opsr::scene::{Scene, SceneParts};

const FRAME: UVec2 = UVec2::new(40, 36);

fn estimators() -> [(Estimator, Rule); 7] {
    let vcm = Estimator::Vcm(Radius::default());
    [
        (Estimator::Light, Rule::Plain),
        (Estimator::Bdpt, Rule::Plain),
        (Estimator::Bdpt, Rule::constant(0.5)),
        (vcm, Rule::Plain),
        (vcm, Rule::constant(0.5)),
        (Estimator::VcmNee(Radius::default()), Rule::Plain),
        (Estimator::Sppm(Radius::default()), Rule::Plain),
    ]
}

fn parts() -> SceneParts {
    with_sphere(coated("coat", Rgb::splat(0.5), 0.0))
}

fn blank(window: Window) -> Picture {
    Picture {
        film: Film::cropped(FRAME, window).expect("inside"),
        aovs: Some(FirstHit::new(window).into()),
        levels: None,
    }
}

/// A picture of these passes at this number of threads.
fn picture(
    scene: &Scene,
    (estimator, rule): &(Estimator, Rule),
    window: Window,
    threads: usize,
    passes: &[u32],
) -> Picture {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let settings = Settings {
        estimator: *estimator,
        rule: rule.clone(),
        seed: 3,
        ..Settings::default()
    };
    let mut picture = blank(window);
    pool.expect("threads").install(|| {
        let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
        let mut first = 0;
        for &n in passes {
            (settings.integrator()).pass(&view, first..first + n, &mut picture);
            first += n;
        }
    });
    picture
}

#[test]
fn determinism_of_light_paths_at_any_thread_count_and_split() {
    let scene = scene(parts());
    let full = Window::full(FRAME);
    for estimator in estimators() {
        let whole = picture(&scene, &estimator, full, 1, &[6]);
        assert_eq!(whole.film.rejected.total(), 0);
        for (threads, passes) in [(2, &[1, 5][..]), (7, &[6]), (3, &[2, 3, 1])] {
            assert!(whole == picture(&scene, &estimator, full, threads, passes));
        }
    }
}

#[test]
fn determinism_of_a_crop_with_light_paths() {
    let scene = scene(parts());
    let full = Window::full(FRAME);
    let window = Window {
        x: 7,
        y: 11,
        w: 20,
        h: 15,
    };
    for estimator in estimators() {
        let whole = picture(&scene, &estimator, full, 2, &[4]);
        let crop = picture(&scene, &estimator, window, 2, &[4]);
        assert_eq!(whole.film.cut(window).pixels, crop.film.pixels);
    }
}

#[test]
fn resume_of_light_paths_is_bit_identical() {
    let scene = scene(parts());
    let full = Window::full(FRAME);
    let folder = quick_folder();
    let path = folder.path().join("a.ckpt");
    for estimator in estimators() {
        let settings = Settings {
            estimator: estimator.0,
            rule: estimator.1.clone(),
            seed: 3,
            ..Settings::default()
        };
        let fingerprint = Fingerprint {
            version: "1".into(),
            scene: "box".into(),
            settings: settings.fingerprint(),
        };
        let stopped = Checkpoint {
            fingerprint: fingerprint.clone(),
            samples: 2,
            seconds: 0.0,
            levels: Vec::new(),
            picture: picture(&scene, &estimator, full, 2, &[2]),
        };
        stopped.save(&path).expect("written");
        let mut resumed = Checkpoint::load(&path, &fingerprint).expect("ours").picture;
        let view = View::of(&scene, &scene.parts().cameras[0], &resumed.film);
        settings.integrator().pass(&view, 2..5, &mut resumed);
        assert!(resumed == picture(&scene, &estimator, full, 1, &[5]));
    }
}

#[test]
fn black_scene_without_lights() {
    let mut parts = super::scenes::walls(diffuse("walls", Rgb::ONE));
    parts.environment = None;
    let scene = Scene::new(parts);
    for estimator in estimators() {
        let picture = picture(&scene, &estimator, Window::full(FRAME), 2, &[2]);
        assert!(picture.film.mean().pixels.iter().all(|&p| p == Rgb::ZERO));
        assert_eq!(picture.film.rejected.total(), 0);
    }
}
