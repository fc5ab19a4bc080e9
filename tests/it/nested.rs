//! Bodies that overlap: which boundaries exist, and between which indices.

use super::support::render::{film_with, mean, scene};
use opsr::image::Film;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Amounts, Estimator, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::regularise::Rule;
use opsr::scene::{Environment, Material, SceneParts};
use opsr_lab::gallery::materials::{diffuse, emitter, glass, metal, tinted_glass};
use opsr_lab::gallery::shapes::{Placing, cuboid, quad, room, sphere};
use opsr_lab::stats::agreement::agree;

fn assert_mean(film: &Film, expected: f64, what: &str) {
    let (mean, error) = mean(film);
    assert!(
        (mean - expected).abs() < 4.0 * error + 1e-4 * expected,
        "{what}: {mean} ± {error}, not {expected}"
    );
}

fn deep(estimator: Estimator) -> Settings {
    Settings {
        estimator,
        max_vertices: 64,
        roulette_start: 32,
        ..Settings::default()
    }
}

const PATH: Estimator = Estimator::Path { reuse: false };

/// Lamp, floor and brushed ball inside a block of tinted glass, with further bodies in it and the camera inside.
fn block(bodies: impl IntoIterator<Item = (Material, Vec3, f32)>) -> SceneParts {
    let mut parts = SceneParts::default();
    for (material, centre, radius) in bodies {
        parts.add(material, [sphere(centre, radius, 3)]);
    }
    let half = Vec3::splat(2.0);
    let material = tinted_glass("block", 1.5, 0.0, Rgb::splat(0.1));
    parts.add(material, [cuboid(-half, half)]);
    let floor = quad(Vec3::new(-1.5, -1.5, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    let lamp = quad(Vec3::new(-0.5, 1.5, -0.5), Vec3::X, Vec3::Z);
    parts.add(emitter("lamp", Rgb::splat(5.0)), [lamp]);
    let brushed = metal("brushed", Rgb::splat(0.8), 0.1);
    parts.add(brushed, [sphere(Vec3::new(0.9, -1.0, 0.0), 0.4, 3)]);
    parts.add_camera([0.0, -0.3, 1.8], [0.0, -0.8, 0.0], 60.0);
    parts
}

/// A ball whose index is that of its surroundings at the middle wavelength alone.
#[test]
fn dispersive_body_in_a_body_of_its_index_is_seen() {
    let picture = |dispersion| {
        let ball = Material {
            dispersion,
            ..glass("ball", 1.5, 0.0)
        };
        let parts = block([(ball, Vec3::new(0.0, -0.6, 0.8), 0.4)]);
        film_with(&scene(parts), &Settings::default(), 24, 16).mean()
    };
    let (with, without) = (picture(8.0), picture(0.0));
    let pairs = with.pixels.iter().zip(&without.pixels);
    let differing = pairs.filter(|(a, b)| (**a - **b).length() > 0.05 * b.length());
    let share = differing.count() as f64 / with.pixels.len() as f64;
    assert!(share > 0.05, "{share}");
}

#[test]
fn body_of_the_index_around_it_is_invisible() {
    let methods = [
        Settings::default(),
        Settings {
            rule: Rule::constant(0.3),
            ..Settings::default()
        },
        Settings {
            rule: Rule::constant(0.3),
            amounts: Amounts::roughening(&[0.0, 1.0]).expect("scales"),
            ..Settings::default()
        },
        deep(Estimator::Bdpt),
        deep(Estimator::Light),
    ];
    let centre = Vec3::new(-0.2, 0.1, 0.0);
    let same = tinted_glass("same", 1.5, 0.0, Rgb::splat(0.1));
    // A body of another index and a lower priority than the block, whose index holds inside.
    let outranked = Material {
        priority: -1.0,
        ..glass("outranked", 1.2, 0.3)
    };
    for settings in methods {
        let picture = |parts| film_with(&scene(parts), &settings, 24, 16);
        let alone = picture(block([]));
        for body in [&same, &outranked] {
            let with = picture(block([
                (body.clone(), centre, 0.6),
                (body.clone(), centre + Vec3::splat(0.3), 0.5),
            ]));
            // Bidirectional estimators aim light at bodies: the pictures agree within noise, but have other samples.
            if !matches!(settings.estimator, Estimator::Path { .. }) {
                let agreement = agree(&with, &alone).expect("one size");
                assert!(
                    agreement.passed(),
                    "{} {settings:?}: {agreement}",
                    body.name
                );
                continue;
            }
            let (a, b) = (alone.mean(), with.mean());
            let pairs = a.pixels.iter().zip(&b.pixels);
            // Rays in segments round differently: now and then a path takes another turn.
            let differing = pairs.filter(|(a, b)| (**a - **b).length() > 1e-3 * a.length());
            let share = differing.count() as f64 / a.pixels.len() as f64;
            assert!(share < 0.05, "{} {settings:?}: {share}", body.name);
            assert!(mean(&alone).0 > 0.01, "{settings:?} {:?}", mean(&alone));
        }
    }
}

/// A layer between parallel faces: an interface between two indices, or a slab with absorption and length.
#[derive(Clone, Copy)]
enum Layer {
    Face(f64, f64),
    Slab(f64, f64),
}

/// Transmittance of a stack at normal incidence, and its reflectance from behind; intensities add without interference.
fn stack(layers: &[Layer]) -> (f64, f64) {
    layers
        .iter()
        .fold((1.0, 0.0), |(t, back), layer| match *layer {
            Layer::Slab(sigma, length) => {
                let left = (-sigma * length).exp();
                (t * left, back * left * left)
            }
            Layer::Face(a, b) => {
                let r = ((a - b) / (a + b)).powi(2);
                let bounces = 1.0 / (1.0 - back * r);
                (
                    t * (1.0 - r) * bounces,
                    r + (1.0 - r).powi(2) * back * bounces,
                )
            }
        })
}

const GLASS: (f64, f64) = (1.5, 0.2);
const LIQUID: (f64, f64) = (1.33, 0.5);

/// A slab of glass from z = 0 to 1 over a slab of liquid from −1 to 0.1, and a lamp on one side.
fn liquid_in_glass(priorities: [f32; 2], lamp_above: bool) -> SceneParts {
    let mut parts = SceneParts::default();
    let wide = |low, high| {
        let (low, high) = (Vec3::new(-10.0, -10.0, low), Vec3::new(10.0, 10.0, high));
        [cuboid(low, high)]
    };
    let body = |name, (ior, sigma): (f64, f64), priority| Material {
        priority,
        ..tinted_glass(name, ior as f32, 0.0, Rgb::splat(sigma as f32))
    };
    parts.add(body("glass", GLASS, priorities[0]), wide(0.0, 1.0));
    parts.add(body("liquid", LIQUID, priorities[1]), wide(-1.0, 0.1));
    let (at, u, v) = if lamp_above {
        (Vec3::new(-5.0, -5.0, 4.0), Vec3::Y, Vec3::X)
    } else {
        (Vec3::new(-5.0, -5.0, -4.0), Vec3::X, Vec3::Y)
    };
    parts.add(emitter("lamp", Rgb::ONE), [quad(at, u * 10.0, v * 10.0)]);
    parts
}

#[test]
fn analytic_transmittance_of_liquid_in_glass() {
    let ((glass, a), (liquid, b)) = (GLASS, LIQUID);
    // The overlap belongs to the body of the higher priority; without priorities to the smaller one.
    for (priorities, ends) in [([2.0, 1.0], 0.0), ([1.0, 2.0], 0.1), ([0.0, -1.0], 0.0)] {
        let (expected, _) = stack(&[
            Layer::Face(1.0, glass),
            Layer::Slab(a, 1.0 - ends),
            Layer::Face(glass, liquid),
            Layer::Slab(b, 1.0 + ends),
            Layer::Face(liquid, 1.0),
        ]);
        for lamp_above in [true, false] {
            let mut parts = liquid_in_glass(priorities, lamp_above);
            let z = if lamp_above { -3.0 } else { 3.0 };
            parts.add_camera([0.0, 0.0, z], [0.0; 3], 0.5);
            let scene = scene(parts);
            for estimator in [PATH, Estimator::Bdpt] {
                let film = film_with(&scene, &deep(estimator), 16, 512);
                assert_mean(
                    &film,
                    expected,
                    &format!("{priorities:?} {lamp_above} {estimator:?}"),
                );
            }
        }
    }
}

/// Liquid and glass that end in the same plane with the same corners; pose and diagonals of the triangles vary.
#[test]
fn analytic_transmittance_of_touching_bodies() {
    let ((glass, a), (liquid, b)) = (GLASS, LIQUID);
    let slab =
        |low: f32, high: f32| cuboid(Vec3::new(-10.0, -10.0, low), Vec3::new(10.0, 10.0, high));
    let body =
        |(ior, sigma): (f64, f64)| tinted_glass("body", ior as f32, 0.0, Rgb::splat(sigma as f32));
    for (lower, upper) in [(LIQUID, GLASS), (GLASS, LIQUID), (GLASS, GLASS)] {
        let (ior, sigma) = if lower == upper {
            (glass, a)
        } else {
            (liquid, b)
        };
        let (expected, _) = stack(&[
            Layer::Face(1.0, glass),
            Layer::Slab(a, 1.0),
            Layer::Face(glass, ior),
            Layer::Slab(sigma, 1.0),
            Layer::Face(ior, 1.0),
        ]);
        for turn in [0.0, 0.6f32] {
            let there = glam::Quat::from_rotation_x(turn);
            let turned = |mut mesh: opsr::scene::Mesh| {
                mesh.positions.iter_mut().for_each(|p| *p = there * *p);
                mesh
            };
            for camera in [-3.0, 3.0] {
                let mut parts = SceneParts::default();
                parts.add(body(upper), [turned(slab(0.0, 1.0))]);
                parts.add(body(lower), [turned(slab(-1.0, 0.0))]);
                let lamp = match camera < 0.0 {
                    true => quad(Vec3::new(-5.0, -5.0, 4.0), Vec3::Y * 10.0, Vec3::X * 10.0),
                    false => quad(Vec3::new(-5.0, -5.0, -4.0), Vec3::X * 10.0, Vec3::Y * 10.0),
                };
                parts.add(emitter("lamp", Rgb::ONE), [turned(lamp)]);
                // Off the diagonals of the quads.
                let from = there * Vec3::new(0.3, 0.1, camera);
                let to = there * Vec3::new(0.3, 0.1, 0.0);
                parts.add_camera(from.to_array(), to.to_array(), 0.5);
                let scene = scene(parts);
                assert!(scene.features().overlaps);
                for estimator in [PATH, Estimator::Bdpt] {
                    let film = film_with(&scene, &deep(estimator), 12, 512);
                    let what = format!("{lower:?} {upper:?} {turn} {camera} {estimator:?}");
                    assert_mean(&film, expected, &what);
                }
            }
        }
    }
}

#[test]
fn analytic_radiance_at_a_camera_inside_an_overlap() {
    let ((glass, a), (liquid, b)) = (GLASS, LIQUID);
    // The camera is 0.05 above the lower end of the glass.
    let (above, up) = stack(&[Layer::Face(1.0, glass), Layer::Slab(a, 0.95)]);
    let (_, down) = stack(&[
        Layer::Face(1.0, liquid),
        Layer::Slab(b, 1.0),
        Layer::Face(liquid, glass),
        Layer::Slab(a, 0.05),
    ]);
    let expected = glass * glass * above / (1.0 - up * down);
    let mut parts = liquid_in_glass([2.0, 1.0], true);
    parts.add_camera([0.0, 0.0, 0.05], [0.0, 0.001, 1.0], 0.5);
    let scene = scene(parts);
    for estimator in [PATH, Estimator::Bdpt] {
        let film = film_with(&scene, &deep(estimator), 16, 512);
        assert_mean(&film, expected, &format!("{estimator:?}"));
    }
}

#[test]
fn white_furnace_of_nested_bodies_scales_with_the_innermost_index() {
    for count in [1, 2, 5, 12] {
        let index = |i: i32| 1.2 + 0.07 * ((i * 5) % 7) as f32;
        let mut parts = SceneParts {
            environment: Some(Environment::constant(Rgb::ONE)),
            ..SceneParts::default()
        };
        for i in 1..=count {
            let half = Vec3::splat(i as f32);
            parts.add(glass("body", index(i), 0.0), [cuboid(-half, half)]);
        }
        parts.add_camera([0.0; 3], [0.1, 0.0, -1.0], 5.0);
        let settings = Settings {
            max_vertices: 1000,
            roulette_start: 1000,
            ..Settings::default()
        };
        let film = film_with(&scene(parts), &settings, 8, 32);
        assert_mean(
            &film,
            f64::from(index(1)).powi(2),
            &format!("{count} bodies"),
        );
    }
}

#[test]
fn path_and_bidirectional_agree_on_ice_in_a_drink() {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let walls = [left, right, floor, back, front];
    parts.add(diffuse("walls", Rgb::new(0.6, 0.5, 0.4)), walls);
    parts.add(emitter("ceiling", Rgb::new(1.0, 0.9, 0.8)), [ceiling]);
    let at = |x: f32, y0: f32, y1: f32| cuboid(Vec3::new(-x, y0, -x), Vec3::new(x, y1, x));
    let wall = Material {
        priority: 1.0,
        ..glass("glass", 1.5, 0.0)
    };
    parts.add(wall, [at(0.5, 0.1, 1.0), at(0.42, 0.2, 0.95).inverted()]);
    let drink = tinted_glass("drink", 1.33, 0.0, Rgb::new(0.2, 1.0, 2.0));
    parts.add(drink, [at(0.45, 0.15, 0.7)]);
    // Half of the ice is above the drink.
    let ice = glass("ice", 1.31, 0.1);
    parts.add(ice, [sphere(Vec3::new(0.0, 0.7, 0.0), 0.2, 2)]);
    parts.add_camera([0.0, 1.3, 0.95], [0.0, 0.5, 0.0], 60.0);
    let scene = scene(parts);
    assert!(scene.features().overlaps);
    let film = |estimator, spp, seed| {
        let settings = Settings {
            seed,
            ..deep(estimator)
        };
        film_with(&scene, &settings, 16, spp)
    };
    let path = film(PATH, 1024, 1);
    let merges = Estimator::Vcm(Radius {
        first: Some(0.01),
        ..Radius::default()
    });
    for estimator in [Estimator::Bdpt, merges] {
        let agreement = agree(&path, &film(estimator, 256, 2)).expect("one size");
        assert!(
            agreement.image.passed() && agreement.tiles.passed(),
            "{estimator:?}: {agreement}"
        );
    }
}

#[test]
fn overlaps_are_found_and_only_they() {
    let apart = |gap: f32, priority: f32| {
        let mut parts = SceneParts::default();
        let body = Material {
            priority,
            ..glass("glass", 1.5, 0.0)
        };
        parts.add(
            body.clone(),
            [
                sphere(Vec3::ZERO, 1.0, 2),
                sphere(Vec3::ZERO, 0.8, 2).inverted(),
            ],
        );
        parts.add(body, [sphere(Vec3::ZERO, gap, 2)]);
        parts.add(
            emitter("lamp", Rgb::ONE),
            [quad(Vec3::Y * 3.0, Vec3::X, Vec3::Z)],
        );
        scene(parts).features().overlaps
    };
    // In the hollow of a ball, in its wall, crossing its outside; around it.
    assert!(!apart(0.5, 0.0));
    assert!(apart(0.5, 1.0));
    for overlapping in [0.9, 1.2] {
        assert!(apart(overlapping, 0.0), "{overlapping}");
    }
}
