//! Path guiding: the distributions of directions, and pictures against the path tracer's.

use crate::support::render::{film_with, mean, scene};
use opsr::image::film::Film;
use opsr::integrator::guided::quadtree::{Quadtree, Sums, direction, square};
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec2, Vec3};
use opsr::regularise::Rule;
use opsr::sampler::{Independent, SampleSource, Sampler, Seed};
use opsr::scene::procedural::materials::{coated, diffuse, emitter};
use opsr::scene::procedural::shapes::quad;
use opsr::scene::{Material, Scene, SceneParts};
use opsr_lab::gallery::{builtin, caustic_box, cornell_box};
use opsr_lab::stats::agreement::agree;
use opsr_lab::verify::chi_square::p_value;

/// Numbers in [0, 1).
fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut stream = Independent { seed: Seed(seed) }.stream(UVec2::ZERO, 0);
    move || stream.next_1d()
}

/// A density from records of a narrow lamp and of a faint sky, after three iterations, and the sums of the next.
fn learned() -> (Quadtree, Sums) {
    let lamp = square(Vec3::new(0.3, -0.5, 0.8).normalize());
    let (mut sums, mut density) = (Sums::default(), Quadtree::default());
    let mut u = numbers(1);
    for _ in 0..3 {
        for _ in 0..2000 {
            sums.add(
                lamp + 0.08 * Vec2::new(u() - 0.5, u() - 0.5),
                3.0 * u() + 0.1,
            );
            sums.add(Vec2::new(u(), u()), 0.3 * u() + 0.01);
        }
        density = sums.finish();
    }
    (density, sums)
}

#[test]
fn guide_map_of_the_sphere_inverts_and_keeps_areas() {
    let mut u = numbers(2);
    for _ in 0..1000 {
        let p = Vec2::new(u(), u());
        assert!((square(direction(p)) - p).abs().max_element() < 1e-5, "{p}");
    }
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
        let p = square(axis);
        assert!(
            p.min_element() >= 0.0 && p.max_element() < 1.0,
            "{axis}: {p}"
        );
        assert!((direction(p) - axis).length() < 1e-3, "{axis}");
    }
    // A strip of z has the share of its height.
    let n = 100_000;
    let high = (0..n)
        .filter(|_| direction(Vec2::new(u(), u())).z > 0.6)
        .count();
    let share = high as f64 / f64::from(n);
    assert!((share - 0.2).abs() < 0.005, "{share}");
}

#[test]
fn guide_density_integrates_to_one() {
    let (density, _) = learned();
    // No leaf is smaller than a cell.
    const CELLS: usize = 1 << 10;
    let at = |i: usize| (i as f32 + 0.5) / CELLS as f32;
    let cells = (0..CELLS * CELLS).map(|i| Vec2::new(at(i / CELLS), at(i % CELLS)));
    let sum: f64 = cells.map(|p| f64::from(density.pdf(direction(p)))).sum();
    let integral = sum * 4.0 * std::f64::consts::PI / (CELLS * CELLS) as f64;
    assert!((integral - 1.0).abs() < 1e-3, "{integral}");
    assert_eq!(Quadtree::default().pdf(Vec3::Z), 0.0);
}

#[test]
fn chi_square_of_guide_directions() {
    let (density, _) = learned();
    const CELLS: usize = 64;
    const FINE: usize = 16;
    let mut expected = vec![0.0; CELLS * CELLS];
    let at = |i: usize| (i as f32 + 0.5) / (CELLS * FINE) as f32;
    for i in 0..CELLS * FINE {
        for j in 0..CELLS * FINE {
            let pdf = density.pdf(direction(Vec2::new(at(i), at(j))));
            expected[i / FINE * CELLS + j / FINE] += f64::from(pdf);
        }
    }
    let n = 400_000;
    let sum: f64 = expected.iter().sum();
    expected.iter_mut().for_each(|e| *e *= f64::from(n) / sum);
    let mut u = numbers(3);
    let mut counts = vec![0u32; CELLS * CELLS];
    for _ in 0..n {
        let p = CELLS as f32 * square(density.sample(Vec2::new(u(), u())).0);
        counts[p.x as usize * CELLS + p.y as usize] += 1;
    }
    let p = p_value(&counts, &expected);
    assert!(p > 0.01, "{p}");
}

#[test]
fn guide_is_refined_where_light_comes_from() {
    let (density, sums) = learned();
    let lamp = Vec3::new(0.3, -0.5, 0.8).normalize();
    let (bright, dark) = (sums.leaf_edge(square(lamp)), sums.leaf_edge(square(-lamp)));
    assert!(bright < 0.02 && dark > 0.1, "{bright} {dark}");
    assert!(density.pdf(lamp) > 100.0 * density.pdf(-lamp));
}

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

/// Fails unless guided pictures agree with those of the path tracer at the scale of tiles and of the whole.
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

/// A floor beside a long low lamp: light samples and directions find it about equally well, and a guide knows it.
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

/// Films of passes of these lengths at so many threads.
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

/// The guide is the same at any number of threads, in any split into passes, and where a new process continues. The last
/// samples are taken after learning has ended.
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
