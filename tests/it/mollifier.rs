//! The mollifier: light that no sampling technique can find becomes visible, and nothing else changes.

use super::support::render::{film_with, mean, scene};
use super::support::scenes::point_light_over_plane;
use opsr::integrator::Settings;
use opsr::math::{Rgb, Vec3};
use opsr::regularise::Rule;
use opsr::scene::{PunctualLight, SceneParts};
use opsr_lab::gallery::materials::{diffuse, metal};
use opsr_lab::gallery::shapes::quad;
use opsr_lab::gallery::{builtin, caustic_box};
use std::f32::consts::PI;

fn settings(rule: Rule) -> Settings {
    Settings {
        rule,
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
fn mollifier_shows_a_point_light_in_a_mirror() {
    let scene = scene(floor_and_mirror());
    // Radiance ½/π · I cos θ / d², directly and from the light behind the mirror at (2, 1, 0).
    let (direct, mirrored) = (1.0, 1.0 / 5f64.powf(1.5));
    let (plain, _) = mean(&film_with(&scene, &settings(Rule::Plain), 8, 16));
    assert!((plain - direct).abs() < 1e-3, "{plain}");
    let film = film_with(&scene, &settings(Rule::Mollifier(0.1)), 32, 2048);
    let (value, error) = mean(&film);
    assert!(error < 0.03 * mirrored, "too noisy: {error}");
    assert!(
        (value - direct - mirrored).abs() < 0.08 * mirrored,
        "{value} ± {error}, expected {}",
        direct + mirrored
    );
}

#[test]
fn mollifier_leaves_findable_light_bit_identical() {
    for parts in [caustic_box(), point_light_over_plane()] {
        let scene = scene(parts);
        let render = |rule| film_with(&scene, &settings(rule), 16, 8);
        assert_eq!(render(Rule::Mollifier(0.1)), render(Rule::Plain));
    }
}

/// The mirror image of thousands of point lights in water has the energy of small balls that path tracing finds.
#[test]
fn mollifier_shows_a_panel_of_lights_over_water() {
    let of = |name: &str| scene(builtin(name).expect("a scene"));
    let (points, balls) = (of("panel-over-water"), of("panel-over-water-balls"));
    assert_eq!(points.parts().lights.len(), 4194);
    let render = |scene, rule, spp| mean(&film_with(scene, &settings(rule), 24, spp));
    let (plain, _) = render(&points, Rule::Plain, 16);
    let (mollified, noise) = render(&points, Rule::Mollifier(0.1), 512);
    let (reference, error) = render(&balls, Rule::Plain, 256);
    assert!(plain < 0.5 * reference, "{plain} of {reference}");
    let ratio = mollified / reference;
    let uncertainty = (noise / mollified).hypot(error / reference);
    assert!(uncertainty < 0.03, "too noisy: {noise}, {error}");
    // A wide kernel has little noise, and a bias of some hundredths.
    assert!((ratio - 1.0).abs() < 0.15, "{ratio} ± {uncertainty}");
}
