//! Scenes with light on paths so narrow that an estimator may find none of it and state no error.
//!
//! They are held out: no table is trained on them.

use super::materials::{COPPER, coated, diffuse, emitter, glass, metal};
use super::shapes::{Placing, cuboid, height_field, quad, revolve, ring, room, sphere};
use super::{light_panel, v2, v3};
use opsr::image::Buffer;
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Environment, Material, Mesh, PunctualLight, SceneParts};

/// Colour of the sun; scenes scale it to irradiance or radiance.
const SUN: Rgb = v3(1.0, 0.95, 0.85);

/// A horizontal square of this half width that faces up.
fn floor(half: f32) -> Mesh {
    quad(
        v3(-half, 0.0, -half),
        Vec3::Z * 2.0 * half,
        Vec3::X * 2.0 * half,
    )
}

/// A ball of glass in the sun on a floor of this half width. The camera's view of it does not depend on the width.
pub(super) fn ball_on_floor(half: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor(half)]);
    let ball = sphere(v3(0.0, 0.501, 0.0), 0.5, 4);
    parts.add(glass("glass", 1.5, 0.0), [ball]);
    parts.lights.push(PunctualLight::Directional {
        direction: v3(0.5, -1.0, -0.2).normalize(),
        irradiance: SUN * 3.0,
    });
    parts.add_camera([1.2, 2.2, 3.0], [0.3, 0.25, -0.1], 36.0);
    parts
}

/// A ring of polished copper on the floor of a hall, ten metres below a small lamp.
pub(super) fn ring_under_lamp() -> SceneParts {
    let mut parts = SceneParts::default();
    let walls = room(v3(-8.0, 0.0, -8.0), v3(8.0, 10.5, 8.0));
    parts.add(diffuse("walls", Rgb::splat(0.4)), walls);
    parts.add(metal("copper", COPPER, 0.005), [ring(0.3, 0.03, 0.25, 64)]);
    parts.add(
        emitter("lamp", v3(1.0, 0.9, 0.75) * 20_000.0),
        [light_panel(v3(1.5, 10.0, 0.8), 0.1, 0.1)],
    );
    parts.add_camera([0.0, 1.6, 1.5], [0.0, 0.05, 0.0], 36.0);
    parts
}

/// A closed room with a window, a thin pane of smooth glass, through which the sun shines on floor and wall.
pub(super) fn sun_through_pane() -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, _, floor, ceiling, back, front] = room(v3(-2.0, 0.0, -2.0), v3(2.0, 2.5, 2.0));
    let white = diffuse("walls", v3(0.75, 0.72, 0.66));
    parts.add(white.clone(), [left, ceiling, back, front]);
    parts.add(diffuse("floor", v3(0.45, 0.3, 0.2)), [floor]);
    // The wall on the right is opaque and thick, with an opening of 1.2 m by 1.2 m.
    let part = |z: [f32; 2], y: [f32; 2]| cuboid(v3(2.0, y[0], z[0]), v3(2.2, y[1], z[1]));
    let wall = [
        part([-2.2, -0.6], [-0.2, 2.7]),
        part([0.6, 2.2], [-0.2, 2.7]),
        part([-0.6, 0.6], [-0.2, 0.8]),
        part([-0.6, 0.6], [2.0, 2.7]),
    ];
    parts.add(white, wall);
    let pane = Material {
        transmission: 1.0,
        ..coated("pane", v3(0.95, 0.98, 0.96), 0.0)
    };
    parts.add(
        pane,
        [quad(v3(2.1, 0.8, -0.6), Vec3::Y * 1.2, Vec3::Z * 1.2)],
    );
    parts.lights.push(PunctualLight::Directional {
        direction: v3(-1.0, -0.6, 0.15).normalize(),
        irradiance: SUN * 12.0,
    });
    parts.add_camera([-1.4, 1.5, 1.8], [0.4, 0.8, -0.6], 66.0);
    parts
}

/// A puddle on a pavement, which reflects the light of a street lamp to a wall.
pub(super) fn street_lamp() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(diffuse("asphalt", Rgb::splat(0.12)), [floor(30.0)]);
    let wall = quad(v3(-30.0, 0.0, -1.6), Vec3::X * 60.0, Vec3::Y * 8.0);
    parts.add(diffuse("wall", v3(0.55, 0.45, 0.38)), [wall]);
    // A film of water reflects a few per cent over dark asphalt.
    let waves =
        |x: f64, z: f64| 0.004 + 0.0006 * ((23.0 * x + 9.0 * z).sin() + (31.0 * z - 8.0 * x).sin());
    let puddle = height_field(v2(-0.6, -0.9), v2(0.7, 0.3), [64, 64], waves);
    let water = Material {
        ior: 1.33,
        ..coated("puddle", Rgb::splat(0.05), 0.0)
    };
    parts.add(water, [puddle]);
    parts.add(
        emitter("lamp", v3(1.0, 0.75, 0.45) * 3_000.0),
        [light_panel(v3(0.4, 6.0, 2.6), 0.2, 0.2)],
    );
    parts.add(
        metal("post", Rgb::splat(0.3), 0.3),
        [cuboid(v3(0.9, 0.0, 2.5), v3(1.0, 6.0, 2.6))],
    );
    parts.add_camera([-0.9, 1.6, 3.4], [0.1, 0.7, -1.2], 50.0);
    parts
}

/// A glass on a table in a field of one kilometre, under a sky map whose sun is a single texel.
pub(super) fn glass_in_field() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(diffuse("field", v3(0.25, 0.3, 0.12)), [floor(500.0)]);
    parts.add(
        diffuse("table", v3(0.6, 0.55, 0.5)),
        [cuboid(v3(-0.5, 0.7, -0.4), v3(0.5, 0.74, 0.4))],
    );
    let profile = [
        v2(0.0, 0.0),
        v2(0.036, 0.0),
        v2(0.036, 0.12),
        v2(0.033, 0.12),
        v2(0.033, 0.012),
        v2(0.0, 0.012),
    ];
    let tumbler = revolve(&profile, false, 64).moved(v3(0.0, 0.7401, 0.0));
    parts.add(glass("glass", 1.5, 0.0), [tumbler]);
    let sky = |x: usize, y: usize| match (x, y) {
        // A sun of 1.4° by 1.4° some 40° above the horizon.
        (190, 35) => SUN * 5e3,
        (_, 0..64) => v3(0.25, 0.4, 0.7) * (0.5 + y as f32 / 64.0),
        _ => v3(0.1, 0.1, 0.08),
    };
    parts.environment = Some(Environment::from_map(Buffer::from_fn(256, 128, sky), 0.0));
    parts.add_camera([-0.28, 1.02, 0.36], [0.0, 0.77, -0.02], 30.0);
    parts
}

/// A small bright plate above a floor, under a dim sky that is a mesh: the sky has nearly all power, the plate gives
/// nearly all light on the floor.
pub(super) fn plate_under_mesh_sky() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor(2.0)]);
    let dome = sphere(Vec3::ZERO, 100.0, 3).inverted();
    parts.add(emitter("sky", v3(0.5, 0.7, 1.0) * 0.02), [dome]);
    parts.add(
        emitter("plate", v3(1.0, 0.9, 0.7) * 40.0),
        [light_panel(v3(0.2, 0.9, -0.4), 0.3, 0.3)],
    );
    let block = cuboid(v3(-0.7, 0.0, -0.5), v3(-0.3, 0.4, -0.1));
    parts.add(diffuse("block", v3(0.6, 0.3, 0.25)), [block]);
    parts.add_camera([0.0, 1.5, 2.6], [0.0, 0.25, -0.2], 40.0);
    parts
}

/// A lamp closed in a thick ball of glass: all light of the room comes through its smooth surface.
pub(super) fn lamp_in_glass() -> SceneParts {
    let mut parts = SceneParts::default();
    let walls = room(v3(-1.5, 0.0, -1.5), v3(1.5, 2.2, 1.5));
    parts.add(diffuse("walls", v3(0.7, 0.65, 0.55)), walls);
    let at = v3(0.2, 0.9, -0.3);
    let shell = [sphere(at, 0.3, 4), sphere(at, 0.06, 3).inverted()];
    parts.add(glass("glass", 1.5, 0.0), shell);
    parts.add(
        emitter("lamp", v3(1.0, 0.85, 0.6) * 400.0),
        [sphere(at, 0.03, 2)],
    );
    let stand = cuboid(v3(0.05, 0.0, -0.45), v3(0.35, 0.59, -0.15));
    parts.add(diffuse("stand", v3(0.3, 0.35, 0.4)), [stand]);
    parts.add_camera([0.3, 1.2, 1.4], [0.1, 0.8, -0.4], 62.0);
    parts
}
