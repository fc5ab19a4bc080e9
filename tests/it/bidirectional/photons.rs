//! Hard cases of photons: sharp lobes under lights without area, and parts thinner than the radius.

use crate::support::render::{film_with, mean, scene};
use opsr::image::Film;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Estimator, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Environment, Material, PunctualLight, Scene, SceneParts};
use opsr_lab::gallery::materials::{coated, diffuse, emitter, metal};
use opsr_lab::gallery::shapes::{quad, sphere};
use opsr_lab::gallery::thin_parts;
use std::f32::consts::PI;

const PATH: Estimator = Estimator::Path { reuse: false };

fn film(scene: &Scene, estimator: Estimator, size: u32, spp: u32, max_vertices: u32) -> Film {
    let settings = Settings {
        estimator,
        max_vertices,
        ..Settings::default()
    };
    film_with(scene, &settings, size, spp)
}

/// A ball of this material, without lights.
fn ball(material: Material) -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(material, [sphere(Vec3::ZERO, 1.0, 3)]);
    parts.add_camera([0.0, 0.0, 6.0], [0.0, 0.0, 0.0], 24.0);
    parts
}

/// A plate of this material, in which the camera sees the mirror image of a light in front of the plate.
fn plate(material: Material) -> SceneParts {
    let mut parts = SceneParts::default();
    let corner = Vec3::new(-1.0, -1.0, 0.0);
    parts.add(material, [quad(corner, Vec3::X * 2.0, Vec3::Y * 2.0)]);
    parts.add_camera([0.0, 0.0, 6.0], [0.0, 0.0, 0.0], 24.0);
    parts
}

/// No walk can hit a light without area, and photons do not merge at sharp lobes: only light samples find it there.
#[test]
fn photon_density_shows_lights_without_area_in_sharp_lobes() {
    let white = Rgb::splat(20.0);
    let position = Vec3::new(0.6, 0.6, 4.0);
    let lights = [
        (
            "point",
            PunctualLight::Point {
                position,
                intensity: white,
                range: f32::INFINITY,
            },
        ),
        (
            "spot",
            PunctualLight::Spot {
                position,
                direction: -position.normalize(),
                intensity: white,
                range: f32::INFINITY,
                cos_inner: 0.97,
                cos_outer: 0.9,
                falloff: Default::default(),
            },
        ),
        (
            "directional",
            PunctualLight::Directional {
                direction: -position.normalize(),
                irradiance: Rgb::ONE,
            },
        ),
    ];
    let materials = [
        coated("dark plastic", Rgb::splat(0.02), 0.1),
        metal("metal", Rgb::splat(0.9), 0.04),
        metal("brushed metal", Rgb::splat(0.9), 0.2),
    ];
    let mut off = false;
    for (name, light) in lights {
        for material in &materials {
            let mut parts = plate(material.clone());
            parts.lights.push(light);
            let scene = scene(parts);
            let sppm = Estimator::Sppm(Radius::default());
            let (expected, e) = mean(&film(&scene, PATH, 24, 256, 6));
            let (found, f) = mean(&film(&scene, sppm, 24, 512, 6));
            println!(
                "{name}, {}: {found:.5} ± {f:.5} for {expected:.5} ± {e:.5}",
                material.name
            );
            off |= (found / expected - 1.0).abs() > 0.03;
        }
    }
    assert!(!off);
}

/// Lamps and skies are both hit and sampled: neither is counted twice, whatever its size.
#[test]
fn photon_density_counts_lamps_in_sharp_lobes_once() {
    let lamp = |edge: f32, radiance: f32| {
        let mut parts = ball(metal("metal", Rgb::splat(0.9), 0.1));
        let at = Vec3::new(3.0, 3.0, 4.0);
        let side = at.cross(Vec3::Y).normalize();
        let up = side.cross(at).normalize();
        let corner = at - 0.5 * edge * (side + up);
        let lamp = quad(corner, side * edge, up * edge);
        parts.add(emitter("lamp", Rgb::splat(radiance)), [lamp]);
        parts
    };
    let mut sky = ball(metal("metal", Rgb::splat(0.9), 0.1));
    sky.environment = Some(Environment::constant(Rgb::splat(0.5)));
    for (name, parts) in [
        ("small", lamp(0.1, 400.0)),
        ("large", lamp(6.0, 1.0)),
        ("sky", sky),
    ] {
        let scene = scene(parts);
        let (expected, e) = mean(&film(&scene, PATH, 24, 512, 6));
        assert!(expected > 0.001, "{name} shines away: {expected}");
        let (found, f) = mean(&film(
            &scene,
            Estimator::Sppm(Radius::default()),
            24,
            512,
            6,
        ));
        println!("{name}: {found:.5} ± {f:.5} for {expected:.5} ± {e:.5}");
        assert!((found / expected - 1.0).abs() < 0.02, "{name}");
    }
}

/// A disk of the radius extends beyond all edges of legs, arm, rim and sheet.
#[test]
fn photons_do_not_darken_thin_parts() {
    let scene = scene(thin_parts());
    let (expected, _) = mean(&film(&scene, PATH, 64, 256, 2));
    let fixed = Radius {
        first: Some(0.05),
        alpha: 1.0,
    };
    for (name, estimator) in [
        ("sppm", Estimator::Sppm(Radius::default())),
        ("sppm, wide", Estimator::Sppm(fixed)),
        ("vcm", Estimator::Vcm(Radius::default())),
        ("vcm, wide", Estimator::Vcm(fixed)),
        ("vcm-nee", Estimator::VcmNee(fixed)),
    ] {
        let (found, error) = mean(&film(&scene, estimator, 64, 256, 2));
        let share = found / expected;
        println!("{name}: {share:.4} ± {:.4}", error / expected);
        assert!((0.97..=1.03).contains(&share), "{name}: {share}");
    }
}

/// A strip narrower than the merging disk has the radiance of a plane under the same uniform light.
#[test]
fn photons_on_a_strip_have_the_density_of_a_plane() {
    let seen = |width: f32, radius: f32| {
        let mut parts = SceneParts::default();
        let strip = quad(
            Vec3::new(-0.5 * width, 0.0, -1.0),
            Vec3::Z * 2.0,
            Vec3::X * width,
        );
        parts.add(diffuse("strip", Rgb::splat(0.5)), [strip]);
        parts.lights.push(PunctualLight::Directional {
            direction: -Vec3::Y,
            irradiance: Rgb::splat(2.0 * PI),
        });
        parts.add_camera([0.0, 3.0, 0.001], [0.0, 0.0, 0.0], 1.0);
        let radius = Radius {
            first: Some(radius),
            alpha: 1.0,
        };
        mean(&film(&scene(parts), Estimator::Sppm(radius), 16, 12_000, 1))
    };
    for (width, radius) in [(2.0, 0.2), (0.2, 0.2), (0.06, 0.2)] {
        let (found, _) = seen(width, radius);
        println!("{width}: {found:.4}");
        assert!((found - 1.0).abs() < 0.02, "{width}: {found}");
    }
}
