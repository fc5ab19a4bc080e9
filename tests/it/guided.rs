//! Path guiding: pictures against the path tracer's.

use crate::support::render::{film_with, mean, scene};
use opsr::image::film::Film;
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::Rule;
use opsr::scene::{Material, Scene, SceneParts};
use opsr_lab::gallery::materials::{coated, diffuse, emitter};
use opsr_lab::gallery::shapes::quad;
use opsr_lab::gallery::{builtin, caustic_box, cornell_box};
use opsr_lab::stats::agreement::agree;

fn settings(estimator: Estimator, rule: Rule, seed: u64) -> Settings {
    Settings {
        estimator,
        rule,
        max_vertices: 8,
        seed,
        ..Settings::default()
    }
}

const PATH: Estimator = Estimator::Path { reuse: false };
const GUIDED: Estimator = Estimator::Guided { unbiased: false };
const UNBIASED: Estimator = Estimator::Guided { unbiased: true };

/// Fails unless guided pictures agree with the path tracer's for tiles and for the whole image.
fn assert_agreement(name: &str, parts: SceneParts, rules: [Rule; 2], guided: Estimator, spp: u32) {
    let scene = scene(parts);
    let [expected, rule] = rules;
    let a = film_with(&scene, &settings(PATH, expected, 1), 24, spp);
    let b = film_with(&scene, &settings(guided, rule, 2), 24, spp);
    let agreement = agree(&a, &b).expect("one size");
    println!("{name}: {:.5?} {:.5?}", mean(&a), mean(&b));
    let passed = agreement.tiles.passed() && agreement.image.passed();
    assert!(passed, "{name}: {agreement}");
}

fn pool() -> SceneParts {
    builtin("swimming_pool").expect("a training scene")
}

/// A floor beside a long low lamp, which light and BSDF samples find about equally well, and which a guide learns.
fn floor_beside_a_lamp(floor: Material) -> SceneParts {
    let mut parts = SceneParts::default();
    let ground = quad(Vec3::new(-1.0, 0.0, 2.0), 2.0 * Vec3::X, -4.0 * Vec3::Z);
    parts.add(floor, [ground]);
    let lamp = quad(Vec3::new(1.0, 0.0, 2.0), 0.5 * Vec3::Y, -4.0 * Vec3::Z);
    parts.add(emitter("lamp", Rgb::ONE), [lamp]);
    parts.add_camera([-0.9, 0.4, 0.0], [1.0, 0.0, 0.0], 40.0);
    parts
}

#[test]
fn agreement_of_guided_paths_with_path() {
    let plain = || [Rule::Plain, Rule::Plain];
    let white = Rgb::splat(0.8);
    for floor in [diffuse("matt", white), coated("polished", white, 0.0)] {
        let name = floor.name.clone();
        let parts = floor_beside_a_lamp(floor);
        assert_agreement(&name, parts, plain(), GUIDED, 1024);
    }
    assert_agreement("box", cornell_box(), plain(), GUIDED, 256);
    assert_agreement("caustics", caustic_box(), plain(), GUIDED, 512);
    assert_agreement("pool", pool(), plain(), GUIDED, 512);
}

#[test]
fn agreement_of_guided_regularised_paths_with_path() {
    let rough = || Rule::constant(0.3);
    assert_agreement("caustics", caustic_box(), [rough(), rough()], GUIDED, 512);
    assert_agreement("pool", pool(), [rough(), rough()], GUIDED, 512);
}

#[test]
fn agreement_of_a_regularised_guide_with_plain_path() {
    let rules = || [Rule::Plain, Rule::constant(0.3)];
    assert_agreement("caustics", caustic_box(), rules(), UNBIASED, 512);
    assert_agreement("pool", pool(), rules(), UNBIASED, 512);
}

/// Films of passes of these lengths with this number of threads.
fn film(scene: &Scene, settings: &Settings, threads: usize, passes: &[u32]) -> Film {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let mut picture = Picture::new(Film::new(UVec2::new(40, 36)));
    let mut integrator = settings.integrator();
    pool.build().expect("threads").install(|| {
        let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
        let mut first = 0;
        for &n in passes {
            integrator.pass(&view, first..first + n, &mut picture);
            first += n;
        }
    });
    picture.film
}

/// The guide is the same at any number of threads, in any split into passes, and after a restart. The last samples come
/// after the end of learning.
#[test]
fn determinism_of_guided_paths() {
    let scene = scene(caustic_box());
    for (estimator, rule) in [(GUIDED, Rule::Plain), (UNBIASED, Rule::constant(0.3))] {
        let settings = settings(estimator, rule, 5);
        let whole = film(&scene, &settings, 1, &[260]);
        assert_eq!(film(&scene, &settings, 2, &[1, 5, 16, 238]), whole);
        assert_eq!(film(&scene, &settings, 7, &[130, 130]), whole);
        let mut picture = Picture::new(film(&scene, &settings, 2, &[40]));
        let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
        settings.integrator().pass(&view, 40..260, &mut picture);
        assert_eq!(picture.film, whole, "resumed");
    }
}
