//! Single-sided surfaces: the camera sees through their backs, light does not pass.

use super::support::render::{film_with, mean, scene};
use opsr::integrator::{Estimator, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Camera, Material, Scene, SceneParts};
use opsr_lab::gallery::materials::{diffuse, emitter};
use opsr_lab::gallery::shapes::{Placing, cuboid, quad};

/// A room seen from outside: its walls face inwards, and a lamp hangs under its ceiling.
fn room(double_sided: bool) -> Scene {
    let mut parts = SceneParts::default();
    let wall = Material {
        double_sided,
        ..diffuse("wall", Rgb::splat(0.6))
    };
    parts.add(wall, [cuboid(-Vec3::ONE, Vec3::ONE).inverted()]);
    let corner = Vec3::new(-0.4, 0.9, -0.4);
    parts.add(
        emitter("lamp", Rgb::splat(4.0)),
        [quad(corner, Vec3::X * 0.8, Vec3::Z * 0.8)],
    );
    let from = Vec3::new(0.8, 0.6, 4.5);
    parts.cameras = vec![Camera::look_at(from, Vec3::ZERO, Vec3::Y, 0.6)];
    scene(parts)
}

#[test]
fn camera_looks_through_backs_of_single_sided_surfaces() {
    let picture = |double_sided| film_with(&room(double_sided), &Settings::default(), 16, 16);
    // No light reaches the walls from outside.
    assert_eq!(mean(&picture(true)).0, 0.0);
    assert!(mean(&picture(false)).0 > 0.1);
}

/// Walls block light from both sides for all estimators, and light tracing connects to the camera through their backs.
#[test]
fn bidirectional_paths_see_through_the_same_backs() {
    let room = room(false);
    let of = |estimator, seed| {
        let settings = Settings {
            estimator,
            seed,
            ..Settings::default()
        };
        mean(&film_with(&room, &settings, 16, 256))
    };
    let (path, error) = of(Settings::default().estimator, 1);
    let (both, other) = of(Estimator::Bdpt, 2);
    let apart = (path - both).abs();
    assert!(
        apart < 4.0 * error.hypot(other),
        "{path} {both} ± {error} {other}"
    );
}
