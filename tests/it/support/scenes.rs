//! Scenes of a few surfaces with a known picture.

use super::super::lab::gallery::materials::{diffuse, emitter, glass, metal};
use super::super::lab::gallery::shapes::{cuboid, quad};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{PunctualLight, SceneParts};
use std::f32::consts::PI;

/// A plane y = 0 of albedo 0.5 under a point light of intensity 2π at height 1 above the origin. The radiance at
/// distance r from the origin is (1 + r²)^(−3/2): 1 at the foot.
pub(crate) fn point_light_over_plane() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(
        diffuse("plane", Rgb::splat(0.5)),
        [quad(
            Vec3::new(-20.0, 0.0, -20.0),
            Vec3::Z * 40.0,
            Vec3::X * 40.0,
        )],
    );
    parts.add_camera([0.0, 0.5, 4.0], [0.0, 0.0, 0.0], 20.0);
    parts.lights.push(PunctualLight::Point {
        position: Vec3::Y,
        intensity: Rgb::splat(2.0 * PI),
        range: f32::INFINITY,
    });
    parts
}

/// A slab of glass (index 1.5, roughness `alpha`) between the camera and a wall of radiance 1. A smooth one transmits
/// (1 − R)/(1 + R) = 0.923 at normal incidence, where R = 0.04.
pub(crate) fn glass_slab(alpha: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(
        emitter("wall", Rgb::ONE),
        [quad(
            Vec3::new(-10.0, -10.0, -2.0),
            Vec3::X * 20.0,
            Vec3::Y * 20.0,
        )],
    );
    parts.add(
        glass("slab", 1.5, alpha),
        [cuboid(
            Vec3::new(-5.0, -5.0, -0.1),
            Vec3::new(5.0, 5.0, 0.1),
        )],
    );
    parts.add_camera([0.0, 0.0, 3.0], [0.0, 0.0, 0.0], 4.0);
    parts
}

/// Two mirrors face each other a unit apart; the camera looks at 45° along the gap to a wall of radiance 1 at its far
/// end, over eight reflections. Perfect mirrors (f0 = 1, α = 0) show it with radiance 1.
pub(crate) fn two_mirrors(f0: f32, alpha: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let (x, z) = (Vec3::X * 10.0, Vec3::Z * 20.0);
    parts.add(
        metal("mirrors", Rgb::splat(f0), alpha),
        [
            quad(Vec3::new(-1.0, 0.0, -10.0), z, x),
            quad(Vec3::new(-1.0, 1.0, -10.0), x, z),
        ],
    );
    parts.add(
        emitter("wall", Rgb::ONE),
        [quad(Vec3::new(8.0, 0.0, -10.0), z, Vec3::Y)],
    );
    parts.add_camera([0.0, 0.5, 0.0], [1.0, -0.5, 0.0], 2.0);
    parts
}
