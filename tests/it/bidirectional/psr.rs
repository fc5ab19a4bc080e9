//! Path space regularisation in the bidirectional estimator: light that no strategy can sample is no longer missing.

use crate::support::render::{film_with, mean, scene};
use crate::support::scenes::point_light_over_plane;
use opsr::integrator::{Estimator, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::regularise::Rule;
use opsr::scene::{PunctualLight, SceneParts};
use opsr_lab::gallery::caustic_box;
use opsr_lab::gallery::materials::{diffuse, metal};
use opsr_lab::gallery::shapes::quad;
use std::f32::consts::PI;

const PATH: Estimator = Estimator::Path { reuse: false };

fn settings(estimator: Estimator, rule: Rule) -> Settings {
    Settings {
        estimator,
        rule,
        seed: 4,
        ..Settings::default()
    }
}

fn point(position: Vec3) -> PunctualLight {
    PunctualLight::Point {
        position,
        intensity: Rgb::splat(2.0 * PI),
        range: f32::INFINITY,
    }
}

/// A floor of albedo ½ beside a mirror at x = 1, under a point light at (0, 1, 0). The camera sees the origin in a
/// small mirror at z = 1.5.
fn floor_in_a_mirror() -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    let beside = quad(Vec3::new(1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::Y * 1.5);
    let small = quad(Vec3::new(-1.225, 1.025, 1.5), Vec3::Y * 0.2, Vec3::X * 0.2);
    parts.add(metal("mirror", Rgb::ONE, 0.0), [beside, small]);
    parts.lights.push(point(Vec3::Y));
    parts.add_camera([-1.5, 1.5, 1.0], [0.0, 0.0, 3.0], 0.05);
    parts
}

#[test]
fn psr_shows_a_caustic_of_a_point_light_in_a_mirror() {
    let scene = scene(floor_in_a_mirror());
    // Radiance ½/π · I cos θ / d², directly and from the mirror image of the light at (2, 1, 0).
    let (direct, mirrored) = (1.0, 1.0 / 5f64.powf(1.5));
    let plain = settings(Estimator::Bdpt, Rule::Plain);
    let (plain, _) = mean(&film_with(&scene, &plain, 8, 16));
    assert!((plain - direct).abs() < 1e-3, "{plain}");
    for estimator in [Estimator::Bdpt, PATH] {
        let settings = settings(estimator, Rule::Mollifier(0.1));
        let (value, error) = mean(&film_with(&scene, &settings, 32, 2048));
        println!("{estimator:?}: {value:.4} ± {error:.4}");
        assert!(error < 0.04 * mirrored, "too noisy: {error}");
        let off = (value - direct - mirrored).abs();
        assert!(off < 0.1 * mirrored, "{estimator:?}: {value} ± {error}");
    }
}

/// A lamp in a mirror: a kernel at the longest edge, the camera's, has the same energy as one at the last edge.
#[test]
fn psr_of_both_estimators_has_the_same_energy() {
    let mut parts = SceneParts::default();
    let mirror = quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    // So far away that the radius is a hundredth of ten units.
    let sliver = quad(Vec3::new(0.0, 0.0, -20.0), Vec3::X * 1e-3, Vec3::Y * 1e-3);
    parts.add(metal("mirror", Rgb::ONE, 0.0), [mirror, sliver]);
    parts.lights.push(point(Vec3::new(0.3, 0.2, 1.0)));
    parts.add_camera([-0.3, -0.1, 1.6], [-0.3, -0.1, 0.0], 45.0);
    let scene = scene(parts);
    let energy = |estimator, rule| {
        let settings = settings(estimator, rule);
        mean(&film_with(&scene, &settings, 96, 600))
    };
    assert_eq!(energy(Estimator::Bdpt, Rule::Plain).0, 0.0);
    let [(path, a), (bdpt, b)] = [PATH, Estimator::Bdpt].map(|e| energy(e, Rule::Mollifier(0.01)));
    println!("{path:.4} ± {a:.4}, {bdpt:.4} ± {b:.4}");
    let noise = 3.0 * 3f64.sqrt() * a.hypot(b);
    assert!(noise < 0.3 * path, "{a} {b}");
    assert!((path - bdpt).abs() < 0.03 * path + noise, "{path} {bdpt}");
}

#[test]
fn psr_leaves_samplable_light_bit_identical() {
    for parts in [caustic_box(), point_light_over_plane()] {
        let scene = scene(parts);
        let film = |rule| film_with(&scene, &settings(Estimator::Bdpt, rule), 16, 8);
        assert_eq!(film(Rule::Mollifier(0.1)), film(Rule::Plain));
    }
}
