//! The path tracer against analytic results, against a naive tracer, and against itself.

use super::support::render::{film, film_with, mean, scene, without_noise};
use super::support::scenes;
use opsr::image::{Buffer, Film};
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::{Accumulated, AttenuationTable, Factors, Lookup, Rule};
use opsr::sampler::{Independent, Seed};
use opsr::scene::{Environment, Material, Projection, Scene, SceneParts, Texture, TextureRef};
use opsr_lab::gallery::materials::{
    GOLD, clearcoated, coated, diffuse, emitter, glass, metal, tinted_glass, translucent,
};
use opsr_lab::gallery::shapes::{cuboid, quad, room, sphere};
use opsr_lab::gallery::{self, caustic_box, cornell_box};
use opsr_lab::stats::agreement::agree;
use opsr_lab::verify::simple::Simple;

/// One factor for all paths.
fn constant(gamma: f32, reuse: bool, seed: u64) -> Settings {
    Settings {
        estimator: Estimator::Path { reuse },
        rule: Rule::constant(gamma),
        seed,
        ..Settings::default()
    }
}

/// A table of equal factors.
fn table(gamma: f32, lookup: Lookup) -> Rule {
    Rule::with_table(AttenuationTable {
        lookup,
        ..AttenuationTable::constant(gamma)
    })
}

/// Settings with every rule, and with reuse.
fn every_rule(seed: u64) -> Vec<Settings> {
    let rules = [
        Rule::constant(0.3),
        table(0.3, Lookup::Nearest),
        table(0.3, Lookup::Linear),
        Rule::Pbrt,
        Rule::FilterGlossy(1.0),
        Rule::RoughnessClamp,
        Rule::Mollifier(0.01),
    ];
    let mut every = vec![constant(0.3, true, seed)];
    every.extend(rules.map(|rule| Settings {
        rule,
        seed,
        ..Settings::default()
    }));
    every
}

/// The mean is `expected` to 0.2 % and to four standard errors.
fn assert_mean(film: &Film, expected: f64, what: &str) {
    let (mean, error) = mean(film);
    assert!(
        error < 5e-4 * expected,
        "{what}: too noisy, {mean} ± {error}"
    );
    assert!(
        (mean - expected).abs() < 2e-3 * expected,
        "{what}: {mean} ± {error}, expected {expected}"
    );
}

#[test]
fn white_furnace_of_a_diffuse_sphere_is_uniform() {
    let scene = scene(gallery::furnace_sphere(0.5));
    let settings = Settings {
        max_vertices: 64,
        roulette_start: 8,
        ..Settings::default()
    };
    let film = film_with(&scene, &settings, 16, 1024);
    assert_mean(&film, 1.0, "furnace");
    let exact = Buffer::from_fn(16, 16, |_, _| Rgb::ONE);
    let agreement = agree(&film, &without_noise(&exact)).unwrap();
    assert!(agreement.passed(), "{agreement}");
}

#[test]
fn analytic_radiance_of_lights_over_planes() {
    // Pixels small enough that the formula at the centre is the pixel's value.
    let mut parts = scenes::point_light_over_plane();
    parts.cameras.clear();
    parts.add_camera([0.0, 0.5, 4.0], [0.0, 0.0, 0.0], 0.05);
    assert_mean(
        &film(&scene(parts), Rule::Plain, 2, 4, 1),
        1.0,
        "point light",
    );

    let mut parts = gallery::area_light_over_plane();
    parts.cameras.clear();
    parts.add_camera([0.0, 0.5, 4.0], [0.0, 0.0, 0.0], 0.05);
    let form = 4.0 / std::f64::consts::PI * 0.5f64.sqrt() * 0.5f64.sqrt().atan();
    let film = film(&scene(parts), Rule::Plain, 16, 4096, 1);
    assert_mean(&film, 0.5 * form, "area light");
}

#[test]
fn analytic_transmittance_of_a_glass_slab() {
    let reflected: f64 = 0.04;
    let expected = (1.0 - reflected) / (1.0 + reflected);
    let mut parts = scenes::glass_slab(0.0);
    parts.cameras.clear();
    parts.add_camera([0.0, 0.0, 3.0], [0.0, 0.0, 0.0], 0.5);
    let settings = Settings {
        max_vertices: 64,
        roulette_start: 16,
        ..Settings::default()
    };
    let film = film_with(&scene(parts), &settings, 16, 4096);
    assert_mean(&film, expected, "slab");
}

/// Cubes of half edge 1, 2, … around the origin: bodies of this index that absorb 0.1, 0.2, … per unit length, under a
/// sky of radiance 1.
fn nested_cubes(count: u32, ior: f32) -> SceneParts {
    let mut parts = SceneParts {
        environment: Some(Environment::constant(Rgb::ONE)),
        ..SceneParts::default()
    };
    for i in 1..=count {
        let half = Vec3::splat(i as f32);
        let body = tinted_glass("body", ior, 0.0, Rgb::splat(0.1 * i as f32));
        parts.add(body, [cuboid(-half, half)]);
    }
    parts
}

fn deep() -> Settings {
    Settings {
        max_vertices: 64,
        roulette_start: 32,
        ..Settings::default()
    }
}

#[test]
fn analytic_absorption_around_the_camera() {
    // A camera in the middle of a body: Beer-Lambert, Fresnel and n² at the face, and reflections between two faces.
    let (sigma, n) = (0.5f64, 1.5f64);
    let mut parts = nested_cubes(1, n as f32);
    parts.materials[0].absorption = Rgb::splat(sigma as f32);
    parts.add_camera([0.0; 3], [0.0, 0.0, -1.0], 0.5);
    let reflected: f64 = 0.04;
    let passes = (1.0 - reflected) / (1.0 - reflected * (-2.0 * sigma).exp());
    let expected = n * n * (-sigma).exp() * passes;
    let film = film_with(&scene(parts), &deep(), 16, 4096);
    assert_mean(&film, expected, "inside");
    // Half of an orthographic camera's rays start in the body.
    let mut parts = nested_cubes(1, 1.0);
    parts.add_camera([1.0, 0.0, 0.0], [1.0, 0.0, -1.0], 1.0);
    parts.cameras[0].projection = Projection::Orthographic { half_height: 0.5 };
    let film = film_with(&scene(parts), &deep(), 4, 4);
    for (i, p) in film.mean().pixels.iter().enumerate() {
        let expected = if i % 4 < 2 { (-0.1f32).exp() } else { 1.0 };
        assert!((p.x - expected).abs() < 1e-5, "{i}: {p}");
    }
}

#[test]
fn analytic_absorption_of_nested_bodies() {
    for count in [1, 4, 5, 12] {
        // One unit of the ray in each body: ∑ 0.1 i.
        let depth = 0.05 * f64::from(count * (count + 1));
        for (from, passes) in [(0.0, 1.0), (20.0, 2.0)] {
            let mut parts = nested_cubes(count, 1.0);
            parts.add_camera([0.0, 0.0, from], [0.0, 0.0, from - 1.0], 0.05);
            let film = film_with(&scene(parts), &deep(), 4, 4);
            let expected = (-depth * passes).exp();
            assert_mean(&film, expected, &format!("{count} bodies from {from}"));
        }
    }
}

#[test]
fn analytic_absorption_of_mirrors() {
    let settings = Settings {
        roulette_start: 16,
        ..Settings::default()
    };
    let whole = film_with(&scene(scenes::two_mirrors(1.0, 0.0)), &settings, 8, 4);
    assert_mean(&whole, 1.0, "perfect mirrors");
    // Schlick at 45°: F = f0 + (1 − f0)(1 − cos 45°)⁵, eight times.
    let mut parts = scenes::two_mirrors(0.8, 0.0);
    parts.cameras.clear();
    parts.add_camera([0.0, 0.5, 0.0], [1.0, -0.5, 0.0], 0.05);
    let film = film_with(&scene(parts), &settings, 8, 4);
    let fresnel = 0.8 + 0.2 * (1.0 - 0.5f64.sqrt()).powi(5);
    assert_mean(&film, fresnel.powi(8), "mirrors of 0.8");
}

/// A closed room with an emissive ceiling, which a tracer without light sampling hits soon.
fn lit_room(content: impl FnOnce(&mut SceneParts)) -> Scene {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    parts.add(
        diffuse("walls", Rgb::new(0.6, 0.5, 0.4)),
        [left, right, floor, back, front],
    );
    parts.add(emitter("ceiling", Rgb::new(1.0, 0.9, 0.8)), [ceiling]);
    content(&mut parts);
    parts.add_camera([0.0, 1.0, 0.9], [0.0, 0.7, 0.0], 70.0);
    scene(parts)
}

/// Requires that the path tracer agrees with the naive one.
fn assert_naive_agrees(scene: &Scene, what: &str) {
    let settings = Settings {
        max_vertices: 8,
        roulette_start: 3,
        seed: 1,
        ..Settings::default()
    };
    let real = film_with(scene, &settings, 24, 400);
    let simple = Simple {
        max_vertices: 8,
        seed: 2,
        fault: None,
    };
    let agreement = agree(&real, &simple.film(scene, 24, 400)).unwrap();
    assert!(agreement.passed(), "{what}: {agreement}");
}

#[test]
fn naive_tracer_agrees_on_metal_glass_and_coats() {
    let ball = |x: f32, z: f32| sphere(Vec3::new(x, 0.45, z), 0.4, 3);
    let room = lit_room(|parts| {
        parts.add(metal("gold", GOLD, 0.1), [ball(-0.5, -0.4)]);
        parts.add(glass("frosted", 1.5, 0.3), [ball(0.45, 0.2)]);
        parts.add(
            coated("lacquer", Rgb::new(0.1, 0.3, 0.6), 0.05),
            [cuboid(Vec3::new(0.1, 0.0, -0.9), Vec3::new(0.7, 0.9, -0.4))],
        );
    });
    assert_naive_agrees(&room, "room");
}

#[test]
fn naive_tracer_agrees_on_what_transmits_diffusely() {
    let room = lit_room(|parts| {
        let shade = cuboid(Vec3::new(-0.7, 0.7, -0.7), Vec3::new(0.1, 1.3, 0.1));
        let paper = diffuse("paper", Rgb::splat(0.9));
        parts.add(translucent(paper, 0.5, Rgb::new(0.9, 0.8, 0.5)), [shade]);
        let blade = quad(Vec3::new(0.2, 0.1, 0.4), Vec3::new(0.6, 0.3, -0.8), Vec3::Y);
        let green = coated("leaf", Rgb::new(0.2, 0.6, 0.1), 0.1);
        let leaf = translucent(green, 0.4, Rgb::new(0.5, 0.9, 0.2));
        parts.add(clearcoated(leaf, 0.02), [blade]);
    });
    assert_naive_agrees(&room, "room");
}

#[test]
fn naive_tracer_agrees_on_smooth_glass_and_mirrors() {
    let ball = |x: f32, z: f32| sphere(Vec3::new(x, 0.45, z), 0.4, 3);
    let room = lit_room(|parts| {
        parts.add(metal("mirror", GOLD, 0.0), [ball(-0.5, -0.4)]);
        parts.add(glass("clear", 1.5, 0.0), [ball(0.45, 0.2)]);
        parts.add(
            glass("diamond", 2.4, 0.01),
            [sphere(Vec3::new(-0.1, 0.25, 0.5), 0.2, 3)],
        );
    });
    assert_naive_agrees(&room, "room");
}

#[test]
fn naive_tracer_agrees_under_a_sky() {
    let mut parts = SceneParts::default();
    let sky = |u: f32, v: f32| Rgb::new(0.2 + u, 0.5 + (9.0 * u).sin().abs(), 1.5 - v);
    let map = Buffer::from_fn(32, 16, |x, y| sky(x as f32 / 32.0, y as f32 / 16.0));
    parts.environment = Some(Environment::from_map(map, 0.4));
    parts.add(
        coated("floor", Rgb::splat(0.5), 0.2),
        [quad(
            Vec3::new(-2.0, 0.0, -2.0),
            Vec3::Z * 4.0,
            Vec3::X * 4.0,
        )],
    );
    parts.add(
        metal("gold", GOLD, 0.2),
        [sphere(Vec3::new(-0.5, 0.5, 0.0), 0.5, 3)],
    );
    parts.add(
        glass("glass", 1.5, 0.1),
        [sphere(Vec3::new(0.6, 0.5, 0.2), 0.5, 3)],
    );
    parts.add_camera([0.0, 1.4, 3.0], [0.0, 0.4, 0.0], 45.0);
    assert_naive_agrees(&scene(parts), "sky");
}

#[test]
fn gamma_of_zero_is_bit_identical_to_plain() {
    let scene = scene(caustic_box());
    let plain = film(&scene, Rule::Plain, 24, 8, 3);
    for reuse in [false, true] {
        let zero = constant(0.0, reuse, 3);
        assert_eq!(film_with(&scene, &zero, 24, 8), plain);
    }
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        assert_eq!(film(&scene, table(0.0, lookup), 24, 8, 3), plain);
    }
    assert_ne!(film(&scene, Rule::constant(0.1), 24, 8, 3), plain);
}

#[test]
fn diffuse_scenes_are_bit_identical_under_every_rule() {
    let scene = scene(cornell_box());
    let plain = film(&scene, Rule::Plain, 16, 8, 3);
    for settings in every_rule(3) {
        assert_eq!(film_with(&scene, &settings, 16, 8), plain, "{settings:?}");
    }
    // Such scenes are rendered without a rule; a tracer with a rule gives the same picture.
    assert!(!scene.features().lobes);
    let mut ruled = Film::new(UVec2::splat(16));
    let view = View::of(&scene, &scene.parts().cameras[0], &ruled);
    let tracer = Settings::default().tracer(Rule::constant(0.3));
    let source = Independent { seed: Seed(3) };
    tracer.estimate(&view, &source, 0..8, &mut ruled, &mut ());
    assert_eq!(ruled, plain);
}

#[test]
fn has_lobes_follows_the_materials_in_use() {
    assert!(scene(caustic_box()).features().lobes);
    // An unused material does not count; a texture may reduce any roughness.
    let mut parts = cornell_box();
    let glossy = Material {
        alpha: 0.5,
        ..Material::default()
    };
    parts.materials.push(glossy);
    assert!(!scene(parts.clone()).features().lobes);
    parts.meshes[0].material = parts.materials.len() as u32 - 1;
    assert!(scene(parts.clone()).features().lobes);
    let material = parts.materials.last_mut().unwrap();
    material.alpha = 1.0;
    assert!(!scene(parts.clone()).features().lobes);
    parts.textures.push(Texture::default());
    parts
        .materials
        .last_mut()
        .unwrap()
        .metallic_roughness_texture = Some(TextureRef {
        second: false,
        texture: parts.textures.len() as u32 - 1,
        transform: Default::default(),
    });
    assert!(scene(parts).features().lobes);
}

#[test]
fn table_of_equal_factors_is_the_constant() {
    let scene = scene(caustic_box());
    let one = film(&scene, Rule::constant(0.3), 24, 8, 5);
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        let film = film(&scene, table(0.3, lookup), 24, 8, 5);
        let worst = (one.mean().pixels.iter().zip(&film.mean().pixels))
            .map(|(a, b)| (*a - *b).abs().max_element() / (a.max_element() + 0.01))
            .fold(0.0, f32::max);
        assert!(worst < 1e-3, "{lookup:?}: {worst}");
    }
}

#[test]
fn determinism_under_threads_tiles_and_splits() {
    let scene = scene(caustic_box());
    let camera = &scene.parts().cameras[0];
    for settings in every_rule(9) {
        let render = |threads: usize, cuts: &[u32]| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut picture = Picture {
                film: Film::new(UVec2::new(37, 21)),
                aovs: None,
                levels: None,
            };
            let view = View::of(&scene, camera, &picture.film);
            let mut integrator = settings.integrator();
            for pair in cuts.windows(2) {
                pool.install(|| integrator.pass(&view, pair[0]..pair[1], &mut picture));
            }
            picture.film
        };
        let one = render(1, &[0, 6]);
        for threads in [2, 3, 8] {
            assert_eq!(render(threads, &[0, 6]), one, "{threads} threads");
        }
        assert_eq!(render(2, &[0, 1, 4, 6]), one);
    }
}

#[test]
fn bias_vanishes_with_gamma() {
    // Frosted glass under a large light: plain path tracing converges, and a tiny factor must give the same picture.
    let room = lit_room(|parts| {
        let ball = sphere(Vec3::new(0.0, 0.6, 0.0), 0.5, 3);
        parts.add(glass("frosted", 1.5, 0.2), [ball]);
    });
    let plain = film(&room, Rule::Plain, 16, 1024, 1);
    let tiny = film(&room, Rule::constant(1e-4), 16, 1024, 2);
    let agreement = agree(&plain, &tiny).unwrap();
    assert!(agreement.passed(), "{agreement}");
}

/// A small film of a range of samples.
fn film_of(scene: &Scene, rule: Rule, samples: std::ops::Range<u32>) -> Film {
    let settings = Settings {
        rule,
        ..Settings::default()
    };
    let mut picture = Picture {
        film: Film::new(UVec2::splat(24)),
        aovs: None,
        levels: None,
    };
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, samples, &mut picture);
    picture.film
}

#[test]
fn consistent_variant_roughens_less_with_every_sample() {
    let room = scene(caustic_box());
    let rule = |lambda| {
        Rule::Accumulated(Accumulated {
            factors: Factors::Constant(0.5),
            lambda,
        })
    };
    // Sample 1 has the full surplus.
    let one = |lambda, samples| film_of(&room, rule(lambda), samples).mean();
    assert_eq!(one(0.0, 0..1), one(0.3, 0..1));
    assert_ne!(one(0.0, 7..8), one(0.3, 7..8));
    // At sample 1e9 with λ = 0.49 the surplus is scaled by 4e-5, next to nothing.
    let late = 1_000_000_000;
    let plain = film_of(&room, Rule::Plain, late..late + 64);
    let vanishing = film_of(&room, rule(0.49), late..late + 64);
    let strong = film_of(&room, rule(0.0), late..late + 64);
    let distance = |a: &Film, b: &Film| -> f64 {
        (a.mean().pixels.iter().zip(&b.mean().pixels))
            .map(|(a, b)| f64::from((*a - *b).abs().element_sum().min(1.0)))
            .sum()
    };
    assert!(distance(&vanishing, &plain) < 0.2 * distance(&strong, &plain));
}
