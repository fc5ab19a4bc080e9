//! Scenes of many lights: the choice among them is unbiased, and of low variance.

use crate::integrator::Settings;
use crate::math::{Ray, Rgb, UVec2, Vec2, Vec3};
use crate::regularise::Rule;
use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};
use crate::scene::{
    Environment, LightDensity, Material, Mesh, PunctualLight, Scene, SceneParts, TriangleId,
};
use crate::unit::lab::gallery::materials::{diffuse, emitter};
use crate::unit::lab::gallery::shapes::{Placing, cuboid, quad, room, sphere};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::lab::verify::chi_square::p_value;
use crate::unit::lab::verify::simple::Simple;
use crate::unit::support::assert_likely;
use crate::unit::support::render::{film, film_with, mean, scene};

fn stream(seed: u64) -> IndependentStream {
    Independent { seed: Seed(seed) }.stream(UVec2::ZERO, 0)
}

/// A floor under an emissive ball of many triangles, seen below the ball.
fn ball_over_floor() -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    parts.add(
        emitter("ball", Rgb::ONE),
        [sphere(Vec3::new(0.0, 2.0, 0.0), 0.05, 6)],
    );
    parts.add_camera([0.0, 0.5, 1.5], [0.0, 0.0, 0.0], 1.0);
    parts
}

#[test]
fn a_lamp_that_lights_nothing_changes_nothing() {
    let settings = Settings {
        max_vertices: 1,
        ..Settings::default()
    };
    let alone = film_with(&scene(ball_over_floor()), &settings, 4, 16_384);
    let mut parts = ball_over_floor();
    // A panel below the floor that faces down, with a thousand times the power of the ball.
    let panel = quad(Vec3::new(-0.5, -1.0, -0.5), Vec3::X, Vec3::Z);
    parts.add(emitter("lamp", Rgb::splat(31.42)), [panel]);
    let beside = film_with(&scene(parts), &settings, 4, 16_384);
    let (expected, found) = (mean(&alone), mean(&beside));
    println!("mean without lamp {expected:?}, beside the lamp {found:?}");
    assert!(
        (found.0 / expected.0 - 1.0).abs() < 0.02,
        "{found:?} {expected:?}"
    );
    // The ball as a disk: radiance 1, form factor (r/h)².
    assert!(
        (expected.0 / (0.5 / 1600.0) - 1.0).abs() < 0.01,
        "{expected:?}"
    );
}

#[test]
fn energy_of_a_lamp_near_the_end_of_single_precision() {
    // Radiance times area times pi overflows single precision.
    let picture = |radiance: f32| {
        let mut parts = SceneParts::default();
        let floor = quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0);
        parts.add(diffuse("floor", Rgb::splat(0.01)), [floor]);
        let lamp = quad(Vec3::new(-2.0, 3.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0);
        parts.add(emitter("lamp", Rgb::splat(radiance)), [lamp]);
        parts.add_camera([0.0, 2.0, 3.0], [0.0, 0.0, 0.0], 40.0);
        mean(&film(&scene(parts), Rule::Plain, 4, 256, 0))
    };
    let (dim, bright) = (picture(1.0), picture(1e38));
    assert!(
        (bright.0 / 1e38 / dim.0 - 1.0).abs() < 1e-4,
        "{bright:?} {dim:?}"
    );
}

#[test]
fn a_sun_outside_a_closed_room_changes_nothing() {
    let closed = |sun: bool| {
        let mut parts = SceneParts::default();
        let walls = room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
        parts.add(diffuse("walls", Rgb::splat(0.6)), walls);
        parts.add(
            emitter("ball", Rgb::ONE),
            [sphere(Vec3::new(0.0, 1.2, 0.0), 0.2, 5)],
        );
        if sun {
            parts.lights.push(PunctualLight::Directional {
                direction: -Vec3::Y,
                irradiance: Rgb::splat(20.0),
            });
        }
        parts.add_camera([0.0, 0.5, 0.9], [0.0, 0.5, -1.0], 60.0);
        scene(parts)
    };
    let dark = film(&closed(false), Rule::Plain, 16, 512, 1);
    let sunny = film(&closed(true), Rule::Plain, 16, 2048, 2);
    let (expected, found) = (mean(&dark), mean(&sunny));
    println!("mean without sun {expected:?}, with {found:?}");
    assert!(
        (found.0 / expected.0 - 1.0).abs() < 0.01,
        "{found:?} {expected:?}"
    );
    let agreement = agree(&dark, &sunny).unwrap();
    assert!(agreement.passed(), "{agreement}");
}

/// Lights of every kind around the origin: small and huge, one- and double-sided, coincident, slivers, and at infinity.
fn all_light_kinds() -> SceneParts {
    let mut u = stream(3);
    let mut next = || u.next_1d();
    let mut parts = SceneParts::default();
    let mut vector = |scale: f32| scale * (2.0 * Vec3::new(next(), next(), next()) - Vec3::ONE);
    for i in 0..40 {
        let (corner, e, f) = (vector(3.0), vector(0.4), vector(0.4));
        let strength = 10f32.powi(i % 5 - 2);
        let light = Material {
            double_sided: i % 3 == 0,
            ..emitter("panel", Rgb::splat(strength))
        };
        let panel = quad(corner, e, f);
        // Every tenth twice, and every eighth a sliver.
        let twice = (i % 10 == 0).then(|| panel.clone());
        let sliver = (i % 8 == 0).then(|| quad(corner + Vec3::Y, e, 1e-5 * f));
        parts.add(light, [panel].into_iter().chain(twice).chain(sliver));
    }
    parts.add(
        emitter("huge", Rgb::splat(1e-4)),
        [quad(
            Vec3::new(-50.0, 40.0, -50.0),
            Vec3::X * 100.0,
            Vec3::Z * 100.0,
        )],
    );
    parts.add(emitter("ball", Rgb::ONE), [sphere(Vec3::X, 0.3, 2)]);
    for i in 0..12 {
        let (position, intensity) = (vector(3.0), Rgb::splat(0.1 * i as f32));
        let range = if i % 4 == 0 { 5.0 } else { f32::INFINITY };
        parts.lights.push(if i % 2 == 0 {
            PunctualLight::Point {
                position,
                intensity,
                range,
            }
        } else {
            PunctualLight::Spot {
                position,
                direction: vector(1.0).normalize(),
                intensity,
                range,
                cos_inner: 0.95,
                cos_outer: [0.1, 0.7, 0.94][i % 3],
                falloff: Default::default(),
            }
        });
    }
    for _ in 0..2 {
        parts.lights.push(PunctualLight::Directional {
            direction: vector(1.0).normalize(),
            irradiance: Rgb::splat(0.2),
        });
    }
    parts.environment = Some(Environment::constant(Rgb::splat(0.05)));
    parts
}

/// Number of lights, as [`crate::scene::Lights::pmf`] counts them.
fn count(scene: &Scene) -> usize {
    let parts = scene.parts();
    let environment = usize::from(parts.environment.is_some());
    scene.lights().emissive_triangles() + parts.lights.len() + environment
}

/// Points inside, near and far from [`zoo`]; some on its lights.
fn points(scene: &Scene) -> Vec<Vec3> {
    let mut u = stream(4);
    let mut points = vec![Vec3::ZERO, Vec3::splat(1e4), Vec3::new(0.0, -60.0, 0.0)];
    for scale in [0.1, 1.0, 3.0, 3.0, 3.0, 10.0] {
        let p = Vec3::new(u.next_1d(), u.next_1d(), u.next_1d());
        points.push(scale * (2.0 * p - Vec3::ONE));
    }
    for i in [0, 7, 100] {
        let [a, b, c] = scene.geometry().triangle(TriangleId::single(i));
        points.push((a + b + c) / 3.0);
        points.push(a);
    }
    points
}

#[test]
fn chi_square_of_the_light_tree() {
    let scene = scene(all_light_kinds());
    let (lights, n) = (scene.lights(), count(&scene));
    let mut found = Vec::new();
    let mut u = stream(5);
    for from in points(&scene) {
        let pmf: Vec<f64> = (0..n).map(|k| lights.pmf(k, from).into()).collect();
        let sum: f64 = pmf.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{from}: {sum}");
        let draws = 400_000;
        let mut counts = vec![0u32; n];
        for _ in 0..draws {
            let (k, p, rest) = lights.sample_light(from, u.vertex().light.pick).unwrap();
            assert!(
                f64::from(p) == pmf[k] && (0.0..1.0).contains(&rest),
                "{from}"
            );
            counts[k] += 1;
        }
        let expected: Vec<f64> = pmf.iter().map(|p| p * f64::from(draws)).collect();
        found.push((p_value(&counts, &expected), format!("{from}")));
    }
    assert_likely(&found);
}

#[test]
fn every_light_that_reaches_a_point_has_a_probability() {
    let scene = scene(all_light_kinds());
    let (lights, parts) = (scene.lights(), scene.parts());
    let area = lights.emissive_triangles();
    assert_eq!(area, scene.geometry().triangle_count());
    let mut u = stream(6);
    for _ in 0..400 {
        let from = 8.0 * (Vec3::new(u.next_1d(), u.next_1d(), u.next_1d()) - Vec3::splat(0.5));
        for k in 0..area {
            let id = TriangleId::single(k as u32);
            let [a, b, c] = scene.geometry().triangle(id);
            let normal = scene.geometry().triangle_normal(id);
            let material = scene.geometry().triangle_material(id) as usize;
            let cos = [a, b, c].map(|corner| normal.dot(from - corner));
            // Outside the rounding error of the plane.
            let lit = cos.iter().any(|&c| c > 1e-4) || parts.materials[material].double_sided;
            assert!(
                !lit || lights.pmf(k, from) > 0.0,
                "triangle {k} from {from}"
            );
        }
        for (i, light) in parts.lights.iter().enumerate() {
            let lit = match *light {
                PunctualLight::Point { intensity, .. } => intensity != Rgb::ZERO,
                PunctualLight::Spot {
                    position,
                    direction,
                    cos_outer,
                    ..
                } => (from - position).normalize().dot(direction) > cos_outer,
                PunctualLight::Directional { .. } => true,
            };
            assert!(
                !lit || lights.pmf(area + i, from) > 0.0,
                "{light:?} from {from}"
            );
        }
        assert!(lights.pmf(count(&scene) - 1, from) >= 0.01);
    }
}

#[test]
fn densities_of_light_samples_match_those_of_rays() {
    let scene = scene(all_light_kinds());
    let lights = scene.lights();
    let area = lights.emissive_triangles();
    let (mut u, mut met) = (stream(7), [0; 3]);
    for from in points(&scene) {
        for _ in 0..20_000 {
            let numbers = u.vertex().light;
            let (k, pmf, _) = lights.sample_light(from, numbers.pick).unwrap();
            let Some(light) = lights.sample(from, numbers) else {
                continue;
            };
            assert!(light.density.value() > 0.0 && light.density.value().is_finite());
            let expected = match light.density {
                LightDensity::Delta(_) => {
                    met[0] += 1;
                    assert!(k >= area);
                    pmf
                }
                LightDensity::SolidAngle(_) if light.distance.is_infinite() => {
                    met[1] += 1;
                    lights.pdf_environment(from, light.wi)
                }
                LightDensity::SolidAngle(_) => {
                    let Some(hit) = scene.intersect(&Ray::new(from, light.wi)) else {
                        continue;
                    };
                    // Another light may occlude the sampled one, also a coincident one.
                    if hit.triangle.index() as usize != k
                        || light.cos < 1e-2
                        || light.distance < 1e-2
                    {
                        continue;
                    }
                    met[2] += 1;
                    lights.pdf_emitter(from, &scene.surface(&hit))
                }
            };
            let found = light.density.value();
            let error = (found / expected - 1.0).abs();
            assert!(error < 2e-3, "light {k} from {from}: {found} {expected}");
        }
    }
    assert!(met.iter().all(|&n| n > 1000), "{met:?}");
}

#[test]
fn few_lights_are_chosen_by_power() {
    let mut parts = crate::unit::lab::gallery::cornell_box();
    parts.environment = Some(Environment::constant(Rgb::ONE));
    let scene = scene(parts);
    for k in 0..3 {
        for from in [Vec3::ZERO, Vec3::splat(3.0)] {
            assert_eq!(scene.lights().pmf(k, from), scene.lights().emission_pmf(k));
        }
    }
}

/// A hall of 40 × 40 × 4 with n × n lights of edge 0.1 below its ceiling, and pillars.
fn hall(n: u16) -> SceneParts {
    let mut parts = SceneParts::default();
    let (low, high) = (Vec3::new(-20.0, 0.0, -20.0), Vec3::new(20.0, 4.0, 20.0));
    parts.add(diffuse("walls", Rgb::splat(0.5)), room(low, high));
    let pillar = |i: u16| {
        let at = Vec3::new(
            f32::from(i % 4) * 10.0 - 15.0,
            0.0,
            f32::from(i / 4) * 10.0 - 15.0,
        );
        cuboid(
            at - 0.5 * Vec3::new(1.0, 0.0, 1.0),
            at + Vec3::new(0.5, 4.0, 0.5),
        )
    };
    parts.add(diffuse("pillars", Rgb::splat(0.3)), (0..16).map(pillar));
    let mut u = stream(8);
    let step = 38.0 / f32::from(n);
    let lights = (0..n * n).map(|i| {
        let at = Vec3::new(f32::from(i % n), 0.0, f32::from(i / n)) * step;
        let shift = Vec3::new(u.next_1d(), 0.0, u.next_1d()) * 0.5 * step;
        let corner = at + shift + Vec3::new(-19.0, 3.8, -19.0);
        quad(corner, Vec3::X * 0.1, Vec3::Z * 0.1)
    });
    let strength = 2e4 / f32::from(n).powi(2);
    let lights = Mesh::joined(lights.collect::<Vec<_>>());
    parts.add(emitter("lights", Rgb::splat(strength)), [lights]);
    parts.add_camera([12.0, 1.6, 12.0], [-5.0, 1.2, -5.0], 60.0);
    parts
}

#[test]
fn the_light_tree_is_unbiased() {
    // A naive tracer needs lights that it can hit.
    let mut parts = hall(4);
    for mesh in &mut parts.meshes {
        if parts.materials[mesh.material as usize].name == "lights" {
            let material = mesh.material;
            *mesh = Mesh {
                material,
                ..quad_grid()
            };
        }
    }
    let scene = scene(parts);
    let settings = Settings {
        max_vertices: 3,
        ..Settings::default()
    };
    let with_tree = film_with(&scene, &settings, 16, 256);
    let simple = Simple {
        max_vertices: 3,
        seed: 2,
        fault: None,
    };
    let agreement = agree(&with_tree, &simple.film(&scene, 16, 4096)).unwrap();
    assert!(agreement.passed(), "{agreement}");
}

/// Nine panels of edge 6 that face down.
fn quad_grid() -> Mesh {
    Mesh::joined((0..9u8).map(|i| {
        let at = Vec3::new(f32::from(i % 3), 0.0, f32::from(i / 3)) * 12.0;
        quad(
            at + Vec3::new(-15.0, 3.8, -15.0),
            Vec3::X * 6.0,
            Vec3::Z * 6.0,
        )
    }))
}

/// Relative variance of one light sample of the light that a white floor with this normal reflects at the points.
/// Lights are chosen by the light tree, by power, and with other probabilities.
fn variances(
    scene: &Scene,
    points: &[Vec3],
    normal: Vec3,
    other: impl Fn(usize) -> f64,
) -> [f64; 3] {
    let lights = scene.lights();
    let mut u = stream(9);
    let mut sums = [0.0; 3];
    for &from in points {
        let n = 20_000;
        let (mut mean, mut squares) = (0.0, [0.0; 3]);
        for _ in 0..n {
            let numbers = u.vertex().light;
            let (k, pmf, _) = lights.sample_light(from, numbers.pick).unwrap();
            let Some(light) = lights.sample(from, numbers) else {
                continue;
            };
            let ray = Ray {
                t_max: 0.999 * light.distance,
                ..Ray::new(from + 1e-3 * normal, light.wi)
            };
            if scene.occluded(&ray) {
                continue;
            }
            let value = light.radiance.x * light.wi.dot(normal).max(0.0) / light.density.value();
            let (value, pmf) = (f64::from(value), f64::from(pmf));
            mean += value;
            // A light drawn with probability q contributes p/q times this second moment.
            let others = [pmf, lights.emission_pmf(k).into(), other(k)];
            for (sum, q) in squares.iter_mut().zip(others) {
                *sum += value * value * pmf / q;
            }
        }
        let mean = mean / f64::from(n);
        for (sum, square) in sums.iter_mut().zip(squares) {
            *sum += square / f64::from(n) / (mean * mean) - 1.0;
        }
    }
    sums.map(|sum| sum / points.len() as f64)
}

/// A floor below a lamp that has this share of the power of a dim sky, a sphere of 1280 triangles.
fn lamp_and_sky(share: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    let (radius, radiance, edge) = (20.0f32, 0.05, 0.2);
    let sky = sphere(Vec3::ZERO, radius, 3).inverted();
    parts.add(emitter("sky", Rgb::splat(radiance)), [sky]);
    let lamp = quad(Vec3::new(-0.1, 1.5, -0.1), Vec3::X * edge, Vec3::Z * edge);
    let power = radiance * 4.0 * std::f32::consts::PI * radius * radius;
    parts.add(
        emitter("lamp", Rgb::splat(share * power / (edge * edge))),
        [lamp],
    );
    parts.add_camera([0.0, 3.0, 4.0], [0.0, 0.0, 0.0], 40.0);
    parts
}

#[test]
fn variance_of_a_lamp_below_a_dim_sky() {
    for share in [1e-3, 1e-2] {
        let scene = scene(lamp_and_sky(share));
        let sky = scene.lights().emissive_triangles() - 2;
        // Half of the samples for each mesh, as in renderers that choose meshes uniformly.
        let by_mesh = |k: usize| if k < sky { 0.5 / sky as f64 } else { 0.25 };
        let mut u = stream(10);
        let points: Vec<Vec3> = (0..32)
            .map(|_| 4.0 * (Vec3::new(u.next_1d(), 0.0, u.next_1d()) - Vec3::new(0.5, 0.0, 0.5)))
            .collect();
        let [tree, power, uniform] = variances(&scene, &points, Vec3::Y, by_mesh);
        println!(
            "lamp of {share} of a sky: variance by tree {tree:.3}, by power {power:.3}, uniform {uniform:.3}"
        );
        assert!(
            tree < 1.5 * power.min(uniform),
            "{share}: {tree} {power} {uniform}"
        );
    }
}

#[test]
fn variance_in_a_hall_of_many_lights() {
    let scene = scene(hall(70));
    let mut u = stream(11);
    let mut place = || 18.0 * Vec2::new(u.next_1d() - 0.5, u.next_1d() - 0.5);
    let points: Vec<Vec3> = (0..64)
        .map(|_| place())
        .map(|p| Vec3::new(p.x, 1e-3, p.y))
        .collect();
    let one = 1.0 / scene.lights().emissive_triangles() as f64;
    let [tree, power, uniform] = variances(&scene, &points, Vec3::Y, |_| one);
    println!("hall: variance by tree {tree:.3}, by power {power:.3}, uniform {uniform:.3}");
    assert!(tree < 0.3 * power, "{tree} {power}");
}
