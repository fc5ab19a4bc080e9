//! Bit-identical pictures at any number of threads, in any split into passes, and of a crop.

use crate::support::holds;
use crate::support::render::film_with;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Estimator, Settings};
use opsr::math::Rgb;
use opsr::scene::Scene;
use opsr_lab::gallery::materials::diffuse;
use opsr_lab::verify::{Size, repeat};

#[test]
fn determinism_at_any_thread_count_and_split_and_of_a_crop() {
    holds(repeat::determinism(Size::Tiny));
}

#[test]
fn black_scene_without_lights() {
    let mut parts = super::scenes::walls(diffuse("walls", Rgb::ONE));
    parts.environment = None;
    let scene = Scene::new(parts);
    for estimator in [
        Estimator::Light,
        Estimator::Bdpt,
        Estimator::Vcm(Radius::default()),
        Estimator::Sppm(Radius::default()),
        Estimator::Mlt { mutations: 2 },
    ] {
        let settings = Settings {
            estimator,
            ..Settings::default()
        };
        let film = film_with(&scene, &settings, 32, 2);
        assert!(film.mean().pixels.iter().all(|&p| p == Rgb::ZERO));
    }
}
