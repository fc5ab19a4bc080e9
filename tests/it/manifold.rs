//! Manifold sampling compared with estimators that find the same light by other techniques.

use super::support::render;
use opsr::image::Film;
use opsr::integrator::{Estimator, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Mesh, PunctualLight, Scene, SceneParts};
use opsr_lab::gallery::{materials, shapes};

fn settings(estimator: Estimator, seed: u64) -> Settings {
    Settings {
        estimator,
        seed,
        max_vertices: 5,
        ..Settings::default()
    }
}

/// Side of the picture in pixels; tiles are 4 × 4.
const SIDE: u32 = 12;

/// A lamp that shines down from a height, of constant power for any side.
fn lamp(mut parts: SceneParts, height: f32, side: f32) -> Scene {
    let corner = Vec3::new(-0.5 * side, height, -0.5 * side);
    let quad = shapes::quad(corner, side * Vec3::X, side * Vec3::Z);
    let radiance = Rgb::splat(20.0 / (side * side));
    parts.add(materials::emitter("lamp", radiance), [quad]);
    render::scene(parts)
}

/// A point light at a height, and a sun.
fn point_and_sun(mut parts: SceneParts, height: f32) -> Scene {
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(0.3, height, -0.2),
        intensity: Rgb::splat(20.0),
        range: f32::INFINITY,
    });
    parts.lights.push(PunctualLight::Directional {
        direction: Vec3::new(0.3, -1.0, 0.1).normalize(),
        irradiance: Rgb::new(2.0, 1.5, 1.0),
    });
    render::scene(parts)
}

fn floor(height: f32, side: f32) -> Mesh {
    let corner = Vec3::new(-0.5 * side, height, -0.5 * side);
    shapes::quad(corner, side * Vec3::Z, side * Vec3::X)
}

fn on_floor(height: f32, side: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(
        materials::diffuse("white", Rgb::splat(0.6)),
        [floor(height, side)],
    );
    parts
}

/// A polished ball that casts a reflected caustic on the floor.
fn mirror_ball() -> SceneParts {
    let mut parts = on_floor(0.0, 6.0);
    let ball = shapes::sphere(Vec3::new(0.0, 0.8, 0.0), 0.8, 4);
    let metal = materials::metal("mirror", Rgb::new(0.9, 0.7, 0.5), 0.0);
    parts.add(metal, [ball]);
    parts.add_camera([3.0, 3.0, 3.0], [0.0, 0.2, 0.0], 40.0);
    parts
}

/// A ball of tinted glass, with its caustic on the floor.
fn glass_ball() -> SceneParts {
    let mut parts = on_floor(0.0, 4.0);
    let ball = shapes::sphere(Vec3::new(0.0, 0.7, 0.0), 0.5, 4);
    let absorption = Rgb::new(0.3, 0.1, 0.05);
    parts.add(
        materials::tinted_glass("ball", 1.5, 0.0, absorption),
        [ball],
    );
    parts.add_camera([2.0, 2.0, 2.0], [0.0, 0.1, 0.0], 40.0);
    parts
}

/// A floor under water with a spherical surface, seen from inside the water.
fn round_water() -> SceneParts {
    let mut parts = on_floor(-0.5, 2.0);
    let water = shapes::sphere(Vec3::ZERO, 2.0, 4);
    let absorption = Rgb::new(0.3, 0.1, 0.05);
    parts.add(
        materials::tinted_glass("water", 1.33, 0.0, absorption),
        [water],
    );
    parts.add_camera([0.5, 0.8, 0.4], [0.0, -0.5, 0.0], 60.0);
    parts
}

/// A floor under flat water, whose vertical sides reflect too.
fn flat_water() -> SceneParts {
    let mut parts = on_floor(-0.5, 1.9);
    let water = shapes::cuboid(Vec3::new(-1.0, -1.0, -1.0), Vec3::new(1.0, 0.5, 1.0));
    parts.add(materials::glass("water", 1.33, 0.0), [water]);
    parts.add_camera([0.3, 0.3, 0.3], [0.0, -0.5, 0.0], 60.0);
    parts
}

/// Asserts equal means within noise, or within a relative bias, of the whole picture and of each tile.
fn assert_agree(name: &str, [a, b]: [&Film; 2], bias: f64) {
    let films = [a, b].map(|film| (film.mean().pixels, film.variance_of_mean().pixels));
    let z = |of: &dyn Fn(usize) -> bool| {
        let [(a, s), (b, t)] = films.each_ref().map(|(means, variances)| {
            let sum = |pixels: &[Rgb]| {
                let those = pixels.iter().enumerate().filter(|(i, _)| of(*i));
                those.map(|(_, p)| f64::from(p.element_sum())).sum::<f64>()
            };
            // Channels of a pixel are fully correlated.
            (sum(means), 3.0 * sum(variances))
        });
        // Two black pictures agree.
        let z = (a - b) / (s + t).sqrt();
        (if a == b { 0.0 } else { z }, a, b)
    };
    let whole = z(&|_| true);
    println!("{name}: {whole:?}");
    assert!(
        whole.0.abs() < 3.5 || (whole.1 / whole.2 - 1.0).abs() < bias,
        "{name}: {whole:?}"
    );
    for tile in 0..9 {
        let (x, y) = (tile % 3, tile / 3);
        let found = z(&|i| (i % SIDE as usize / 4, i / SIDE as usize / 4) == (x, y));
        assert!(
            found.0.abs() < 4.5 || (found.1 / found.2 - 1.0).abs() < bias,
            "{name}, tile {tile}: {found:?}"
        );
    }
}

fn film(scene: &Scene, estimator: Estimator, seed: u64, samples: u32) -> Film {
    render::film_with(scene, &settings(estimator, seed), SIDE, samples)
}

/// Path tracing hits a large lamp often enough by chance.
#[test]
fn manifold_sampling_has_the_picture_of_path_tracing() {
    for (name, scene) in [
        ("mirror ball", lamp(mirror_ball(), 4.0, 1.5)),
        ("flat water", lamp(flat_water(), 3.0, 1.5)),
        ("round water", lamp(round_water(), 4.0, 2.0)),
        ("glass ball", lamp(glass_ball(), 4.0, 1.0)),
    ] {
        let plain = film(&scene, Estimator::default(), 1, 4096);
        let found = film(&scene, Estimator::Manifold { trials: 0 }, 2, 512);
        assert_agree(name, [&found, &plain], 0.0);
        // With more trials than solutions hardly any solution is missed, except at the rim of the ball.
        let few = film(&scene, Estimator::Manifold { trials: 32 }, 3, 64);
        if name == "glass ball" {
            let ratio = render::mean(&few).0 / render::mean(&plain).0;
            assert!((0.9..1.0).contains(&ratio), "{ratio}");
        } else {
            assert_agree(&format!("{name}, 32 trials"), [&few, &plain], 0.01);
        }
    }
}

/// Lights without area, which path tracing never hits but light paths find.
#[test]
fn manifold_sampling_has_the_picture_of_light_paths() {
    for (name, scene) in [
        ("mirror ball", point_and_sun(mirror_ball(), 4.0)),
        ("round water", point_and_sun(round_water(), 4.0)),
        ("glass ball", point_and_sun(glass_ball(), 4.0)),
    ] {
        let light = film(&scene, Estimator::Bdpt, 1, 2048);
        let found = film(&scene, Estimator::Manifold { trials: 0 }, 2, 512);
        assert_agree(name, [&found, &light], 0.0);
    }
}

/// Light by way of a smooth interface has far less noise.
#[test]
fn manifold_sampling_has_less_noise() {
    let scene = lamp(flat_water(), 3.0, 0.3);
    let variance = |estimator| {
        let pixels = film(&scene, estimator, 3, 64).variance_of_mean().pixels;
        pixels.iter().map(|p| p.element_sum()).sum::<f32>()
    };
    let plain = variance(Estimator::default());
    let found = variance(Estimator::Manifold { trials: 0 });
    println!("{found} {plain}");
    assert!(found < 0.1 * plain, "{found} {plain}");
}

/// Without smooth surfaces the picture is bit-identical to that of the path tracer.
#[test]
fn manifold_sampling_without_casters_changes_nothing() {
    let scene = render::scene(opsr_lab::gallery::cornell_box());
    let [a, b] = [Estimator::default(), Estimator::Manifold { trials: 0 }]
        .map(|estimator| film(&scene, estimator, 4, 4).mean());
    assert_eq!(a.pixels, b.pixels);
}

#[test]
fn manifold_sampling_is_deterministic() {
    let scene = lamp(glass_ball(), 4.0, 0.2);
    let render = || film(&scene, Estimator::Manifold { trials: 0 }, 5, 4).mean();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let alone = pool.expect("a pool").install(render);
    assert_eq!(alone.pixels, render().pixels);
}
