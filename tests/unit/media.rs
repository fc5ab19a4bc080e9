//! Media: closed forms, an analogue tracer, and agreement of estimators.

use crate::bsdf::{Bsdf, Phase};
use crate::image::Film;
use crate::integrator::{Amounts, Estimator, Picture, Recorded, Settings, View};
use crate::math::{Ray, Rgb, UVec2, Vec3};
use crate::regularise::Rule;
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{
    Environment, Falloff, Material, Medium, PunctualLight, Scene, SceneParts, Sensor,
};
use crate::unit::lab::gallery::materials::{diffuse, emitter, glass, metal};
use crate::unit::lab::gallery::shapes::{cuboid, quad, room, sphere};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{film_with, mean, scene};
use std::f64::consts::PI;

const PATH: Estimator = Estimator::Path { reuse: false };

/// A body filled with a medium, with a boundary of this index.
fn filled(ior: f32, medium: Medium) -> Material {
    Material {
        medium: Some(Box::new(medium)),
        ..glass("filled", ior, 0.0)
    }
}

fn medium(absorption: [f32; 3], scattering: [f32; 3], mean_cosine: f32) -> Medium {
    Medium {
        absorption: absorption.into(),
        scattering: scattering.into(),
        mean_cosine,
    }
}

fn deep(estimator: Estimator, vertices: u32, seed: u64) -> Settings {
    Settings {
        estimator,
        max_vertices: vertices,
        roulette_start: 8,
        seed,
        ..Settings::default()
    }
}

/// Mean of each channel of a film, and its standard error.
fn channels(film: &Film) -> [(f64, f64); 3] {
    let (means, variances) = (film.mean(), film.variance_of_mean());
    let n = means.pixels.len() as f64;
    [0, 1, 2].map(|c| {
        let mean: f64 = means.pixels.iter().map(|p| f64::from(p[c])).sum();
        let variance: f64 = variances.pixels.iter().map(|p| f64::from(p[c])).sum();
        (mean / n, variance.sqrt() / n)
    })
}

fn assert_channels(film: &Film, expected: [f64; 3], what: &str) {
    for (c, ((mean, error), expected)) in channels(film).into_iter().zip(expected).enumerate() {
        assert!(
            (mean - expected).abs() < 4.5 * error + 2e-4 * expected,
            "{what}, channel {c}: {mean} ± {error}, not {expected}"
        );
    }
}

/// Light of a wall through a slab and through the medium outside: every channel decays by its own coefficients.
#[test]
fn transmittance_of_a_slab_in_a_medium_is_exponential() {
    let mut parts = SceneParts::default();
    let own = medium([0.1, 0.5, 2.0], [0.0; 3], 0.0);
    let slab = cuboid(Vec3::new(-5.0, -5.0, -1.0), Vec3::new(5.0, 5.0, 1.0));
    parts.add(filled(1.0, own), [slab]);
    parts.medium = Some(medium([0.2, 0.0, 0.05], [0.1, 0.3, 0.0], 0.4));
    let wall = quad(Vec3::new(-9.0, -9.0, -3.0), Vec3::X * 18.0, Vec3::Y * 18.0);
    parts.add(emitter("wall", Rgb::ONE), [wall]);
    parts.add_camera([0.0, 0.0, 2.0], [0.0, 0.0, 0.0], 0.5);
    let scene = scene(parts);
    // At most one vertex: direct light, and light scattered once.
    let settings = deep(PATH, 1, 3);
    let film = film_with(&scene, &settings, 16, 256);
    let direct = [0.3f64, 0.3, 0.05].map(|s| (-3.0 * s).exp());
    let inside = [0.1f64, 0.5, 2.0].map(|s| (-2.0 * s).exp());
    let least: Vec<f64> = direct.iter().zip(inside).map(|(a, b)| a * b).collect();
    let seen = channels(&film);
    // Blue alone is not scattered; red and green gain light scattered once.
    assert!((seen[2].0 - least[2]).abs() < 5.0 * seen[2].1 + 1e-4 * least[2]);
    assert!(
        seen[0].0 > least[0] && seen[0].0 < 1.3 * least[0],
        "{seen:?}"
    );
    assert!(
        seen[1].0 > least[1] && seen[1].0 < 2.0 * least[1],
        "{seen:?}"
    );
}

/// Bodies of a medium that only scatters, with any boundary, are as bright as their surroundings.
#[test]
fn white_furnace_shows_no_medium_that_does_not_absorb() {
    let coloured = |g| medium([0.0; 3], [0.4, 1.5, 6.0], g);
    let cases: [(&str, f32, Medium); 4] = [
        ("isotropic cloud", 1.0, coloured(0.0)),
        ("cloud that scatters forwards", 1.0, coloured(0.8)),
        ("cloud that scatters back", 1.0, coloured(-0.5)),
        ("milk in glass", 1.5, coloured(0.5)),
    ];
    for (name, ior, inside) in cases {
        let mut parts = SceneParts {
            environment: Some(Environment::constant(Rgb::ONE)),
            ..SceneParts::default()
        };
        parts.add(filled(ior, inside), [sphere(Vec3::ZERO, 1.0, 3)]);
        parts.add(
            filled(1.0, coloured(0.2)),
            [cuboid(Vec3::new(0.3, -0.2, -0.9), Vec3::new(1.5, 0.2, 0.4))],
        );
        parts.add_camera([0.0, 0.4, 4.0], [0.0, 0.0, 0.0], 34.0);
        let scene = scene(parts);
        let film = film_with(&scene, &deep(PATH, 2000, 1), 12, 128);
        assert_channels(&film, [1.0; 3], &format!("{name}, path"));
        if ior == 1.0 {
            let film = film_with(&scene, &deep(Estimator::Bdpt, 100, 1), 12, 16);
            assert_channels(&film, [1.0; 3], &format!("{name}, bdpt"));
        }
    }
}

/// A body of a medium is the same in one piece and in pieces that touch at index-matched boundaries.
#[test]
fn medium_is_the_same_however_a_body_is_cut() {
    let own = medium([0.1, 0.2, 0.4], [1.0, 2.0, 0.5], 0.6);
    let picture = |cuts: &[f32], seed| {
        let mut parts = SceneParts::default();
        let edges: Vec<f32> = [-1.0].iter().chain(cuts).chain(&[1.0]).copied().collect();
        for pair in edges.windows(2) {
            let (low, high) = (Vec3::new(pair[0], -0.7, -0.6), Vec3::new(pair[1], 0.7, 0.6));
            parts.add(filled(1.0, own), [cuboid(low, high)]);
        }
        let lamp = quad(Vec3::new(-0.5, 2.0, -0.5), Vec3::X, Vec3::Z);
        parts.add(emitter("lamp", Rgb::splat(6.0)), [lamp]);
        let floor = quad(Vec3::new(-2.0, -1.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0);
        parts.add(diffuse("floor", Rgb::splat(0.6)), [floor]);
        parts.add_camera([0.4, 0.5, 4.0], [0.0, -0.2, 0.0], 40.0);
        film_with(&scene(parts), &deep(PATH, 32, seed), 24, 300)
    };
    let whole = picture(&[], 1);
    for (cuts, seed) in [(&[0.1f32][..], 2), (&[-0.5, 0.2, 0.25], 3)] {
        let agreement = agree(&whole, &picture(cuts, seed)).unwrap();
        assert!(agreement.passed(), "{cuts:?}: {agreement}");
    }
}

/// Light of a point source that the medium scatters once towards the camera, by quadrature along the ray.
#[test]
fn single_scattering_is_its_integral() {
    for g in [0.0f32, 0.7, -0.4] {
        let (absorption, scattering) = ([0.05f32, 0.1, 0.0], [0.2f32, 0.4, 0.1]);
        let (lamp, far) = (Vec3::new(0.7, 0.5, -2.0), 5.0f64);
        let mut parts = SceneParts {
            medium: Some(medium(absorption, scattering, g)),
            lights: vec![PunctualLight::Point {
                position: lamp,
                intensity: Rgb::splat(3.0),
                range: f32::INFINITY,
            }],
            ..SceneParts::default()
        };
        let wall = quad(Vec3::new(-9.0, -9.0, -5.0), Vec3::X * 18.0, Vec3::Y * 18.0);
        parts.add(diffuse("black", Rgb::ZERO), [wall]);
        parts.add_camera([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], 0.01);
        let scene = scene(parts);
        let g = f64::from(g);
        let steps = 20_000;
        let expected = [0, 1, 2].map(|c| {
            let (s, a) = (f64::from(scattering[c]), f64::from(absorption[c]));
            let sum: f64 = (0..steps)
                .map(|i| {
                    let t = (f64::from(i) + 0.5) / f64::from(steps) * far;
                    let to = lamp.as_dvec3() - glam::DVec3::new(0.0, 0.0, -t);
                    let d = to.length();
                    // Light travels from the lamp to the point and then along +z.
                    let cos = -(to / d).z;
                    let phase =
                        (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5));
                    s * phase * 3.0 / (d * d) * (-(s + a) * (t + d)).exp()
                })
                .sum();
            sum * far / f64::from(steps)
        });
        for estimator in [PATH, Estimator::Bdpt] {
            let film = film_with(&scene, &deep(estimator, 1, 5), 16, 400);
            assert_channels(&film, expected, &format!("{estimator:?}, g = {g}"));
        }
    }
}

/// An analogue tracer without light sampling or weights, one channel at a time: photons are absorbed or scattered. A
/// single fog fills the whole scene.
struct Analogue<'a> {
    scene: &'a Scene,
    fog: Medium,
    max_vertices: u32,
}

impl Analogue<'_> {
    fn film(&self, size: u32, spp: u32) -> Film {
        let mut film = Film::new(UVec2::splat(size));
        let sensor = Sensor {
            camera: &self.scene.parts().cameras[0],
            frame: film.size,
        };
        let source = Independent { seed: Seed(77) };
        for index in 0..film.pixels.len() {
            let pixel = film.window.pixel(index);
            for sample in 0..spp {
                let mut stream = source.stream(pixel, sample);
                let place = pixel.as_vec2() + stream.film();
                let mut value = Rgb::ZERO;
                for c in 0..3 {
                    value[c] = self.radiance(sensor.ray(place), c, &mut stream);
                }
                film.push(index, value, sample);
            }
        }
        film
    }

    fn radiance(&self, mut ray: Ray, c: usize, numbers: &mut impl Sampler) -> f32 {
        let (a, s) = (self.fog.absorption[c], self.fog.scattering[c]);
        let (mut sum, mut weight) = (0.0, 1.0);
        for n in 0..=self.max_vertices {
            let hit = self.scene.intersect(&ray);
            let end = hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
            let t = -(1.0 - numbers.next_1d()).ln() / (a + s);
            if t < end {
                if numbers.next_1d() * (a + s) < a || n == self.max_vertices {
                    return sum;
                }
                let peak =
                    (1.0 + self.fog.mean_cosine.abs()) / (1.0 - self.fog.mean_cosine.abs()).powi(2);
                // Rejection sampling.
                let dir = loop {
                    let z = 2.0 * numbers.next_1d() - 1.0;
                    let turn = std::f32::consts::TAU * numbers.next_1d();
                    let flat = (1.0 - z * z).max(0.0).sqrt();
                    let dir = Vec3::new(flat * turn.cos(), flat * turn.sin(), z);
                    let g = self.fog.mean_cosine;
                    let p = (1.0 - g * g) / (1.0 + g * g - 2.0 * g * dir.dot(ray.dir)).powf(1.5);
                    if numbers.next_1d() * peak < p {
                        break dir;
                    }
                };
                ray = Ray::new(ray.origin + t * ray.dir, dir);
                continue;
            }
            let Some(hit) = hit else { return sum };
            let mut surface = self.scene.surface(&hit);
            sum += weight * self.scene.lights().emitted(&surface, -ray.dir)[c];
            let u = numbers.vertex();
            let bsdf = self.scene.bsdf(&mut surface, u.material);
            let frame = surface.frame_for(-ray.dir);
            let sample = bsdf.sample(bsdf.alpha(), frame.to_local(-ray.dir), u.lobe);
            let Some(sample) = sample else { return sum };
            weight *= sample.weight[c];
            ray = surface.spawn(frame.to_world(sample.wi));
        }
        sum
    }
}

/// A room in fog, lit by its ceiling, with a ball.
fn fog_room(fog: Medium, ball: Material) -> Scene {
    let mut parts = SceneParts {
        medium: Some(fog),
        ..SceneParts::default()
    };
    let [left, right, floor, ceiling, back, front] =
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let walls = [left, right, floor, back, front];
    parts.add(diffuse("walls", Rgb::new(0.6, 0.5, 0.4)), walls);
    parts.add(emitter("ceiling", Rgb::new(1.0, 0.9, 0.8)), [ceiling]);
    parts.add(ball, [sphere(Vec3::new(0.2, 0.6, 0.0), 0.4, 3)]);
    parts.add_camera([0.0, 1.0, 0.9], [0.0, 0.7, 0.0], 70.0);
    scene(parts)
}

#[test]
fn path_and_bdpt_in_fog_agree_with_a_tracer_of_photons() {
    for (fog, ball) in [
        (
            medium([0.1, 0.05, 0.2], [0.4, 0.8, 0.2], 0.0),
            metal("metal", Rgb::splat(0.9), 0.2),
        ),
        (
            medium([0.05; 3], [0.9, 0.3, 0.6], 0.6),
            metal("mirror", Rgb::splat(0.9), 0.0),
        ),
    ] {
        let scene = fog_room(fog, ball);
        let analogue = Analogue {
            scene: &scene,
            fog,
            max_vertices: 12,
        };
        let photons = analogue.film(20, 500);
        for (estimator, spp) in [(PATH, 300), (Estimator::Bdpt, 80)] {
            let real = film_with(&scene, &deep(estimator, 12, 1), 20, spp);
            let agreement = agree(&real, &photons).unwrap();
            assert!(agreement.passed(), "{estimator:?} {fog:?}: {agreement}");
        }
    }
}

/// A box of fog under a lamp, with a body in it.
fn fog_box(fog: Option<Medium>, body: Material, lamp: f32) -> Scene {
    let mut parts = SceneParts {
        medium: fog,
        ..SceneParts::default()
    };
    let walls = room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    parts.add(diffuse("walls", Rgb::new(0.7, 0.6, 0.5)), walls);
    let half = 0.5 * lamp;
    let quad = quad(
        Vec3::new(-half, 1.95, -half),
        Vec3::X * lamp,
        Vec3::Z * lamp,
    );
    parts.add(emitter("lamp", Rgb::splat(4.0 / (lamp * lamp))), [quad]);
    parts.add(body, [sphere(Vec3::new(0.1, 0.7, -0.1), 0.5, 3)]);
    parts.add_camera([0.0, 1.0, 0.95], [0.0, 0.8, 0.0], 80.0);
    scene(parts)
}

/// Path tracing and bdpt estimate one picture; they share neither light paths nor weights.
#[test]
fn bdpt_agrees_with_path_in_media() {
    let cases = [
        (
            "fog",
            fog_box(
                Some(medium([0.05, 0.1, 0.1], [0.5, 0.3, 0.8], 0.5)),
                metal("metal", Rgb::splat(0.8), 0.15),
                0.8,
            ),
        ),
        (
            "milk in glass",
            fog_box(
                None,
                Material {
                    alpha: 0.3,
                    ..filled(1.4, medium([0.1, 0.3, 0.8], [3.0, 2.0, 1.5], 0.2))
                },
                1.2,
            ),
        ),
        (
            "coloured cloud",
            fog_box(
                None,
                filled(1.0, medium([0.02, 0.1, 0.3], [4.0, 2.0, 1.0], 0.8)),
                0.6,
            ),
        ),
        (
            "cloud in fog",
            fog_box(
                Some(medium([0.0; 3], [0.2, 0.2, 0.5], -0.3)),
                filled(1.0, medium([0.02, 0.1, 0.3], [2.0, 2.0, 1.0], 0.6)),
                0.9,
            ),
        ),
    ];
    for (name, scene) in cases {
        let path = film_with(&scene, &deep(PATH, 12, 1), 20, 600);
        let bdpt = film_with(&scene, &deep(Estimator::Bdpt, 12, 2), 20, 150);
        let agreement = agree(&path, &bdpt).unwrap();
        assert!(agreement.passed(), "{name}: {agreement}");
    }
}

/// A light without area in a medium.
#[test]
fn bdpt_agrees_with_path_on_spots_in_fog() {
    let mut parts = SceneParts {
        medium: Some(medium([0.05; 3], [0.3, 0.4, 0.5], 0.4)),
        lights: vec![PunctualLight::Spot {
            position: Vec3::new(0.0, 1.8, 0.0),
            direction: -Vec3::Y,
            intensity: Rgb::splat(3.0),
            range: f32::INFINITY,
            cos_inner: 0.98,
            cos_outer: 0.88,
            falloff: Falloff::Squared,
        }],
        ..SceneParts::default()
    };
    let walls = room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    parts.add(diffuse("walls", Rgb::new(0.7, 0.6, 0.5)), walls);
    parts.add_camera([0.0, 1.0, 0.95], [0.0, 0.8, 0.0], 80.0);
    let scene = scene(parts);
    let path = film_with(&scene, &deep(PATH, 10, 1), 20, 400);
    let bdpt = film_with(&scene, &deep(Estimator::Bdpt, 10, 2), 20, 100);
    let agreement = agree(&path, &bdpt).unwrap();
    assert!(agreement.passed(), "{agreement}");
}

/// Factors of 0 change nothing; larger ones roughen a sharp phase function and lose hardly any light.
#[test]
fn rules_roughen_phase_functions() {
    let cloud = filled(1.0, medium([0.0; 3], [2.0, 1.0, 3.0], 0.9));
    let lamp = fog_box(None, cloud.clone(), 0.3);
    let with = |rule, scene: &Scene, spp| {
        let settings = Settings {
            rule,
            ..deep(PATH, 64, 1)
        };
        film_with(scene, &settings, 16, spp)
    };
    let plain = with(Rule::Plain, &lamp, 16);
    assert_eq!(
        plain.mean().pixels,
        with(Rule::constant(0.0), &lamp, 16).mean().pixels
    );
    assert_ne!(
        plain.mean().pixels,
        with(Rule::constant(0.3), &lamp, 16).mean().pixels
    );
    let mut parts = SceneParts {
        environment: Some(Environment::constant(Rgb::ONE)),
        ..SceneParts::default()
    };
    parts.add(cloud, [sphere(Vec3::ZERO, 1.0, 3)]);
    parts.add_camera([0.0, 0.4, 4.0], [0.0, 0.0, 0.0], 34.0);
    let furnace = scene(parts);
    let roughened = with(Rule::constant(0.5), &furnace, 256);
    // Roughened directions leave the cloud on other paths, a bias of a few per cent.
    let (roughened, error) = mean(&roughened);
    assert!((roughened - 1.0).abs() < 0.03 + 4.0 * error, "{roughened}");
}

/// Without anything to roughen all levels are one picture, and the first is that of plain path tracing.
#[test]
fn levels_in_a_medium_begin_with_plain_path_tracing() {
    let cloud = filled(1.0, medium([0.0, 0.1, 0.2], [2.0, 1.0, 3.0], 0.8));
    let scene = fog_box(None, cloud, 0.3);
    let size = 16;
    let settings = Settings {
        rule: Rule::constant(0.1),
        amounts: Amounts::Roughening(Default::default()),
        ..deep(PATH, 12, 4)
    };
    let mut picture = Picture::blank(
        UVec2::splat(size),
        crate::image::film::Window::full(UVec2::splat(size)),
        &settings.amounts,
        Recorded::default(),
    )
    .unwrap();
    let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..64, &mut picture);
    let plain = film_with(&scene, &deep(PATH, 12, 4), size, 64);
    assert_eq!(picture.film.mean().pixels, plain.mean().pixels);
    assert_eq!(picture.film.rejected.total(), 0);
}

/// Levels that roughen a phase function to isotropic have the light of a single level that does.
#[test]
fn levels_of_isotropic_phase_functions_lose_nothing() {
    let mut parts = SceneParts {
        environment: Some(Environment::constant(Rgb::ONE)),
        ..SceneParts::default()
    };
    let cloud = filled(1.0, medium([0.0; 3], [0.5, 1.0, 2.0], 0.8));
    parts.add(cloud, [sphere(Vec3::ZERO, 1.0, 3)]);
    let white = diffuse("white", Rgb::ONE);
    parts.add(white, [sphere(Vec3::ZERO, 0.6, 3)]);
    parts.add_camera([0.0, 0.4, 4.0], [0.0, 0.0, 0.0], 28.0);
    let scene = scene(parts);
    let size = UVec2::splat(16);
    let settings = |amounts| Settings {
        rule: Rule::constant(1.0),
        amounts,
        ..deep(PATH, 64, 5)
    };
    let one = film_with(&scene, &settings(Amounts::Raw), 16, 256);
    let settings = settings(Amounts::roughening(&[0.0, 1.0]).expect("scales"));
    let full = crate::image::film::Window::full(size);
    let mut picture = Picture::blank(size, full, &settings.amounts, Recorded::default()).unwrap();
    let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..256, &mut picture);
    let rough = picture.levels.expect("levels").mean(1);
    let rough = rough
        .pixels
        .iter()
        .map(|p| f64::from(p.element_sum()))
        .sum::<f64>()
        / 768.0;
    let (one, error) = mean(&one);
    assert!(
        (rough - one).abs() < 6.0 * error + 2e-3,
        "{rough} {one} ± {error}"
    );
}

/// An open surface around a medium gives a warning; a closed one gives none, nor one that walls close.
#[test]
fn open_boundary_of_a_medium_is_named() {
    let warnings = |closed: bool, walls: bool| {
        let mut parts = SceneParts {
            own_boundaries: true,
            ..SceneParts::default()
        };
        let water = filled(1.33, medium([0.1; 3], [0.1; 3], 0.0));
        let (low, high) = (Vec3::new(-1.0, -1.0, -1.0), Vec3::new(1.0, 0.0, 1.0));
        let surface = match closed {
            true => cuboid(low, high),
            false => quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::Z * -2.0),
        };
        parts.add(water, [surface]);
        if walls {
            parts.add(
                diffuse("basin", Rgb::splat(0.5)),
                room(low, Vec3::new(1.0, 2.0, 1.0)),
            );
        }
        parts.add_camera([0.0, 0.5, 0.0], [0.0, 0.0, 0.0], 40.0);
        Scene::new(parts).warnings().join("\n")
    };
    assert!(warnings(false, false).contains("does not enclose the medium"));
    assert!(!warnings(true, false).contains("enclose"));
    assert!(!warnings(false, true).contains("enclose"));
}

#[test]
fn determinism_of_media_over_threads() {
    let fog = medium([0.05, 0.1, 0.1], [0.5, 0.3, 0.8], 0.5);
    let cloud = filled(1.0, medium([0.02, 0.1, 0.3], [4.0, 2.0, 1.0], 0.8));
    let scene = fog_box(Some(fog), cloud, 0.6);
    for estimator in [PATH, Estimator::Bdpt] {
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let film = || film_with(&scene, &deep(estimator, 8, 1), 24, 4);
            pool.expect("a few threads").install(film)
        });
        assert_eq!(one.mean().pixels, three.mean().pixels, "{estimator:?}");
    }
}

/// Estimators without scattering media return an error; all but manifold sampling accept media that only absorb.
#[test]
fn estimators_without_media_refuse_them() {
    let ball = || metal("metal", Rgb::splat(0.8), 0.15);
    let fog = fog_box(Some(medium([0.1; 3], [0.1; 3], 0.0)), ball(), 0.5);
    let smoke = fog_box(Some(medium([0.1; 3], [0.0; 3], 0.0)), ball(), 0.5);
    let radius = crate::integrator::bidirectional::Radius::default();
    let all = [
        (PATH, true, true),
        (Estimator::Bdpt, true, true),
        (Estimator::Guided { unbiased: false }, false, true),
        (Estimator::Manifold { trials: 1 }, false, false),
        (Estimator::Light, false, true),
        (Estimator::Vcm(radius), false, true),
        (Estimator::VcmNee(radius), false, true),
        (Estimator::Sppm(radius), false, true),
        (Estimator::Mlt { mutations: 1 }, false, true),
    ];
    for (estimator, in_fog, in_smoke) in all {
        for (scene, knows) in [(&fog, in_fog), (&smoke, in_smoke)] {
            let settings = deep(estimator, 8, 1);
            let checked = settings.check_scene(scene);
            assert_eq!(checked.is_ok(), knows, "{estimator:?}");
        }
    }
    // In a medium that only absorbs all find the same light.
    let path = film_with(&smoke, &deep(PATH, 8, 1), 16, 200);
    for estimator in [
        Estimator::Vcm(radius),
        Estimator::Guided { unbiased: false },
    ] {
        let other = film_with(&smoke, &deep(estimator, 8, 2), 16, 100);
        let ((a, x), (b, y)) = (mean(&path), mean(&other));
        assert!(
            (a - b).abs() < 5.0 * x.hypot(y) + 0.01 * a,
            "{estimator:?}: {a} {b}"
        );
    }
}

/// Value and pdf of the phase function are equal, without a cosine.
#[test]
fn phase_energy_conservation() {
    let phase = Bsdf::Phase(Phase { mean_cosine: 0.7 });
    let eval = phase.eval(phase.alpha(), Vec3::Z, Vec3::new(0.6, 0.0, -0.8));
    assert_eq!(eval.value.x, eval.pdf_w);
}
