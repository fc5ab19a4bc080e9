//! Water over tiled floors.

use super::super::materials::{diffuse, emitter, glass};
use super::super::shapes::{self, Placing, cuboid, height_field, quad};
use super::super::{light_panel, v2, v3};
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::{Mesh, SceneParts};

/// The walls and the floor of a basin below y = 0, fronts inside.
pub(super) fn basin(min: Vec2, max: Vec2, depth: f32) -> Mesh {
    let [a, b, floor, _, c, d] = shapes::room(v3(min.x, -depth, min.y), v3(max.x, 0.0, max.y));
    Mesh::joined([a, b, floor, c, d])
}

/// Waves from a few sines; `scale` stretches them, `height` is their amplitude.
pub(super) fn waves(x: f64, z: f64, scale: f64, height: f64) -> f64 {
    let (x, z) = (x / scale, z / scale);
    let sum = (6.3 * x + 2.1 * z + 0.4).sin()
        + (-2.9 * x + 5.6 * z + 1.7).sin()
        + 0.6 * (8.1 * x - 6.2 * z + 2.9).sin()
        + 0.5 * (1.3 * x + 10.3 * z).sin();
    height * sum
}

/// A shallow and a deep basin in one deck.
pub(super) fn basins() -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, _, ceiling, back, front] =
        shapes::room(v3(-1.5, -0.1, -1.1), v3(1.5, 2.4, 2.0));
    parts.add(
        diffuse("walls", Rgb::splat(0.7)),
        [left, right, ceiling, back, front],
    );
    parts.add(
        emitter("light", v3(1.0, 0.96, 0.9) * 60.0),
        [light_panel(v3(0.1, 2.395, -0.3), 0.33, 0.33)],
    );
    let (shallow, deep) = (
        [v2(-1.3, -0.9), v2(-0.08, 0.9)],
        [v2(0.08, -0.9), v2(1.3, 0.9)],
    );
    parts.add(
        diffuse("sand", v3(0.72, 0.66, 0.52)),
        [basin(shallow[0], shallow[1], 0.3)],
    );
    parts.add(
        diffuse("tiles", v3(0.55, 0.68, 0.72)),
        [basin(deep[0], deep[1], 1.0)],
    );
    // The deck between and around the basins; its sides lie behind the basins' walls.
    let strip = |x0: f32, z0: f32, x1: f32, z1: f32| {
        quad(v3(x0, 0.0, z0), Vec3::Z * (z1 - z0), Vec3::X * (x1 - x0))
    };
    parts.add(
        diffuse("deck", v3(0.6, 0.55, 0.5)),
        [Mesh::joined([
            strip(-1.5, -1.1, 1.5, -0.9),
            strip(-1.5, 0.9, 1.5, 2.0),
            strip(-1.5, -0.9, -1.3, 0.9),
            strip(-0.08, -0.9, 0.08, 0.9),
            strip(1.3, -0.9, 1.5, 0.9),
        ])],
    );
    parts.add(
        glass("shallow water", 1.33, 0.0),
        [height_field(shallow[0], shallow[1], [72, 108], |x, z| {
            waves(x, z, 0.3, 0.012) - 0.05
        })],
    );
    parts.add(
        glass("deep water", 1.33, 0.01),
        [height_field(deep[0], deep[1], [48, 72], |x, z| {
            waves(x, z, 0.45, 0.01) - 0.05
        })],
    );
    parts.add(
        diffuse("stone", v3(0.5, 0.3, 0.25)),
        [cuboid(v3(-0.9, -0.299, -0.5), v3(-0.65, -0.15, -0.3))],
    );
    parts.add_camera([0.0, 1.9, 1.9], [0.0, -0.3, 0.0], 60.0);
    parts
}
