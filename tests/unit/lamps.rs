//! Surfaces as lamps: hidden from the camera, or emitting into a cone.

use crate::integrator::{Estimator, Settings};
use crate::math::{Rgb, Vec3};
use crate::scene::lamp::{Cone, Lamp};
use crate::scene::{Camera, Scene, SceneParts};
use crate::unit::lab::gallery::materials::{diffuse, emitter};
use crate::unit::lab::gallery::shapes::{quad, sphere};
use crate::unit::support::gltf::File;
use crate::unit::support::render::{film_with, mean, scene};
use serde_json::{Value, json};
use std::f64::consts::PI;

const CONE: Cone = Cone {
    direction: Vec3::NEG_Y,
    cos_inner: 0.9,
    cos_outer: 0.7,
};

/// A floor of albedo ½, a metre below a small ball of this radiance; the camera sees it from above, past the ball.
fn spot(lamp: Lamp, radiance: f32) -> Scene {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::Z * -6.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    let mut of = emitter("lamp", Rgb::splat(radiance));
    of.finish_mut().lamp = Some(lamp);
    parts.add(of, [sphere(Vec3::Y, 0.05, 3)]);
    let above = Vec3::new(0.0, 4.0, 0.01);
    parts.cameras = vec![Camera::look_at(above, Vec3::ZERO, -Vec3::Z, 0.8)];
    scene(parts)
}

fn of(scene: &Scene, estimator: Estimator, seed: u64, spp: u32) -> (f64, f64) {
    let settings = Settings {
        estimator,
        seed,
        ..Settings::default()
    };
    mean(&film_with(scene, &settings, 16, spp))
}

#[test]
fn camera_looks_through_a_hidden_lamp_whose_light_stays() {
    let seen = |hidden| {
        let lamp = Lamp { hidden, cone: None };
        let scene = spot(lamp, 100.0);
        let film = film_with(&scene, &Settings::default(), 16, 64);
        let picture = film.mean();
        let middle = picture.pixels[8 * 16 + 8];
        let corner: f32 = picture.pixels[..16].iter().map(|p| p.x).sum();
        (f64::from(middle.x), f64::from(corner))
    };
    let (lamp, light) = seen(false);
    let (floor, same) = seen(true);
    // The irradiance a metre below is π L r²; the floor scatters half of it, over π.
    let expected = 100.0 * 0.05 * 0.05 * 0.5;
    assert!(lamp > 10.0, "{lamp}");
    assert!((floor / expected - 1.0).abs() < 0.1, "{floor} {expected}");
    assert!((same / light - 1.0).abs() < 0.05, "{same} {light}");
}

/// The floor receives the power of the cone: the integral of its smooth step over the sphere of directions.
#[test]
fn floor_under_a_cone_has_its_light() {
    let share = |cos: f64| {
        f64::from(CONE.share(Vec3::new((1.0 - cos * cos).sqrt() as f32, -cos as f32, 0.0)))
    };
    assert_eq!((share(0.95), share(0.6)), (1.0, 0.0));
    assert!((share(0.8) - 0.5).abs() < 1e-5);
    let lamp = Lamp {
        hidden: true,
        cone: Some(CONE),
    };
    let scene = spot(lamp, 100.0);
    // Pixels by their place on the floor, 4 metres below the camera.
    let film = film_with(&scene, &Settings::default(), 16, 256);
    let picture = film.mean();
    let half = 4.0 * f64::from(0.4f32.tan());
    let step = 2.0 * half / 16.0;
    let total: f64 = picture.pixels.iter().map(|p| f64::from(p.x)).sum::<f64>() * step * step;
    // The radiant intensity is π r² L; the floor scatters half of the power, over π.
    let intensity = PI * 0.05 * 0.05 * 100.0;
    let steps = 4000;
    let cone: f64 = (0..steps)
        .map(|i| share((f64::from(i) + 0.5) / f64::from(steps)) / f64::from(steps))
        .sum();
    let expected = 0.5 / PI * intensity * 2.0 * PI * cone;
    assert!((total / expected - 1.0).abs() < 0.03, "{total} {expected}");
}

#[test]
fn integrators_agree_on_a_hidden_lamp_with_a_cone() {
    let lamp = Lamp {
        hidden: true,
        cone: Some(CONE),
    };
    let scene = spot(lamp, 100.0);
    let (path, error) = of(&scene, Settings::default().estimator, 1, 256);
    for estimator in [Estimator::Bdpt, Estimator::Light] {
        let (both, other) = of(&scene, estimator, 2, 256);
        let apart = (path - both).abs();
        assert!(
            apart < 4.0 * error.hypot(other),
            "{path} {both} ± {error} {other}"
        );
    }
}

#[test]
fn load_lamp_from_extras() {
    let loaded = |lamp: Value| {
        let mut file = File::triangle();
        file.push("materials", json!({ "extras": { "lamp": lamp } }));
        file.primitive()["material"] = json!(0);
        let mut loaded = file.loaded();
        let warned = loaded.warnings.iter().any(|w| w.contains("extras.lamp"));
        let lamp = loaded.parts.materials.remove(0).lamp().copied();
        (lamp, warned)
    };
    let cone = json!({ "direction": [0, -2, 0], "cosInner": 0.9, "cosOuter": 0.7 });
    let whole = Lamp {
        hidden: true,
        cone: Some(CONE),
    };
    assert_eq!(
        loaded(json!({ "hidden": true, "cone": cone })),
        (Some(whole), false)
    );
    assert_eq!(loaded(json!({})), (Some(Lamp::default()), false));
    for broken in [
        json!(3),
        json!({ "hidden": "yes" }),
        json!({ "cone": { "direction": [0, 0, 0], "cosInner": 0.9, "cosOuter": 0.7 } }),
        json!({ "cone": { "direction": [0, 0, 1], "cosInner": 0.7, "cosOuter": 0.7 } }),
        json!({ "cone": { "direction": [0, 0, 1], "cosInner": 0.9, "cosOuter": -2 } }),
    ] {
        assert_eq!(loaded(broken.clone()), (None, true), "{broken}");
    }
}
