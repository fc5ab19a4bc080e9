//! The mollifier: what no path can find becomes visible, and nothing else changes.

use super::support::render::{film_with, mean, scene};
use opsr::gallery::materials::{diffuse, metal};
use opsr::gallery::shapes::quad;
use opsr::gallery::{caustic_box, point_light_over_plane};
use opsr::integrator::{Method, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::regularise::Regulariser;
use opsr::regularise::rules::Mollifier;
use opsr::scene::{PunctualLight, SceneParts};
use std::f32::consts::PI;

fn settings(method: Method) -> Settings {
    Settings {
        method,
        seed: 4,
        ..Settings::default()
    }
}

/// A floor of albedo ½ beside a mirror at x = 1, under a point light at (0, 1, 0); the camera sees the origin.
fn floor_and_mirror() -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    let mirror = quad(Vec3::new(1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::Y * 1.5);
    parts.add(metal("mirror", Rgb::ONE, 0.0), [mirror]);
    parts.lights.push(PunctualLight::Point {
        position: Vec3::Y,
        intensity: Rgb::splat(2.0 * PI),
        range: f32::INFINITY,
    });
    parts.add_camera([-1.5, 1.5, 0.0], [0.0, 0.0, 0.0], 0.05);
    parts
}

#[test]
fn a_point_light_is_seen_in_a_mirror() {
    let scene = scene(floor_and_mirror());
    // Radiance ½/π · I cos θ / d², directly and from the light behind the mirror at (2, 1, 0).
    let (direct, mirrored) = (1.0, 1.0 / 5f64.powf(1.5));
    let (plain, _) = mean(&film_with(&scene, &settings(Method::Plain), 8, 16));
    assert!((plain - direct).abs() < 1e-3, "{plain}");
    let film = film_with(&scene, &settings(Method::Mollifier(0.1)), 32, 2048);
    let (value, error) = mean(&film);
    assert!(error < 0.03 * mirrored, "too noisy: {error}");
    assert!(
        (value - direct - mirrored).abs() < 0.08 * mirrored,
        "{value} ± {error}, expected {}",
        direct + mirrored
    );
}

#[test]
fn what_paths_can_find_stays_as_it_is() {
    for parts in [caustic_box(), point_light_over_plane()] {
        let scene = scene(parts);
        let render = |method| film_with(&scene, &settings(method), 16, 8);
        assert_eq!(render(Method::Mollifier(0.1)), render(Method::Plain));
    }
}

#[test]
fn the_kernel_shrinks_with_the_sixth_root() {
    let rule = Mollifier { radius: 0.01 };
    let bandwidth = |sample| rule.bandwidth(&rule.start(sample));
    assert_eq!(bandwidth(0), 0.01);
    assert!((bandwidth(63) - 0.005).abs() < 1e-8);
}
