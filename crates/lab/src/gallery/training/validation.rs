//! Scenes held out from training: other shapes, other materials, other lights.

use super::super::materials::{
    ALUMINIUM, IRON, coated, diffuse, emitter, glass, metal, tinted_glass,
};
use super::super::shapes::{
    self, Placing, blob, curve, cylinder, height_field, quad, revolve, sphere, torus,
};
use super::super::{light_panel, v2, v3};
use super::boxes::lamp;
use super::water::{basin, waves};
use opsr::math::{Vec2, Vec3};
use opsr::scene::{Mesh, SceneParts};

/// A hall with one long pool, chrome rails and a ball, under a skylight.
pub(super) fn swimming_pool() -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, _, ceiling, back, front] =
        shapes::room(v3(-2.0, 0.0, -4.0), v3(2.0, 2.6, 2.0));
    parts.add(
        diffuse("plaster", v3(0.78, 0.74, 0.68)),
        [left, right, ceiling, back, front],
    );
    parts.add(
        emitter("skylight", v3(0.9, 0.97, 1.0) * 55.0),
        [
            light_panel(v3(-0.5, 2.59, -2.6), 0.35, 0.4),
            light_panel(v3(-0.5, 2.59, -0.4), 0.35, 0.4),
        ],
    );
    let (low, high) = (v2(-1.1, -3.4), v2(1.1, 1.0));
    parts.add(
        diffuse("tiles", v3(0.45, 0.68, 0.78)),
        [basin(low, high, 0.7)],
    );
    let strip = |x0: f32, z0: f32, x1: f32, z1: f32| {
        quad(v3(x0, 0.0, z0), Vec3::Z * (z1 - z0), Vec3::X * (x1 - x0))
    };
    parts.add(
        coated("deck", v3(0.5, 0.42, 0.33), 0.2),
        [Mesh::joined([
            strip(-2.0, -4.0, 2.0, low.y),
            strip(-2.0, high.y, 2.0, 2.0),
            strip(-2.0, low.y, low.x, high.y),
            strip(high.x, low.y, 2.0, high.y),
        ])],
    );
    let absorbing = tinted_glass("water", 1.33, 0.0, v3(0.35, 0.08, 0.04));
    parts.add(
        absorbing,
        [height_field(low, high, [56, 112], |x, z| {
            waves(x + 0.3, z, 0.5, 0.014) - 0.08
        })],
    );
    let rail = |z: f32| {
        torus(0.22, 0.025, 48, 10).placed([0.0, 0.0, std::f32::consts::FRAC_PI_2], v3(1.1, 0.02, z))
    };
    parts.add(metal("chrome", IRON, 0.04), [rail(-0.4), rail(-0.9)]);
    parts.add(
        coated("ball", v3(0.8, 0.15, 0.1), 0.03),
        [sphere(v3(-1.5, 0.222, -1.3), 0.22, 3)],
    );
    parts.add_camera([1.5, 1.5, 1.8], [-0.2, -0.1, -1.0], 55.0);
    parts
}

/// A turned figure: profile points of (radius, height) below the crown.
fn figure(profile: &[Vec2], at: Vec3) -> Mesh {
    revolve(&curve(profile, 3), false, 40).moved(at)
}

/// Glass figures on a glossy floor before a curved backdrop.
pub(super) fn figurines() -> SceneParts {
    let mut parts = SceneParts::default();
    // Floor and backdrop in one: flat, then a quarter circle upward behind the figures.
    let backdrop = height_field(v2(-2.5, -2.44), v2(2.5, 1.8), [1, 42], |_, z| {
        // A quarter of an ellipse. It ends above the picture, steep but not vertical.
        let bend = ((-0.9 - z) / 1.55).clamp(0.0, 1.0);
        2.2 * (1.0 - (1.0 - bend * bend).max(0.0).sqrt())
    });
    parts.add(coated("backdrop", v3(0.62, 0.6, 0.65), 0.08), [backdrop]);
    parts.add(
        emitter("softbox", v3(1.0, 0.96, 0.9) * 60.0),
        [lamp(v3(1.0, 2.0, -0.7), v3(0.0, 0.0, 0.2), 0.4)],
    );
    parts.add(
        emitter("fill", v3(0.7, 0.85, 1.0) * 5.0),
        [light_panel(Vec3::ZERO, 0.9, 0.9).placed([0.0, 0.7, -0.7], v3(-1.7, 1.8, 0.9))],
    );
    let pawn = [
        v2(0.0, 0.0),
        v2(0.22, 0.0),
        v2(0.23, 0.06),
        v2(0.11, 0.16),
        v2(0.07, 0.32),
        v2(0.13, 0.38),
        v2(0.09, 0.42),
        v2(0.15, 0.54),
        v2(0.1, 0.66),
        v2(0.0, 0.69),
    ];
    let bishop = [
        v2(0.0, 0.0),
        v2(0.25, 0.0),
        v2(0.26, 0.08),
        v2(0.12, 0.2),
        v2(0.08, 0.5),
        v2(0.16, 0.58),
        v2(0.1, 0.62),
        v2(0.15, 0.76),
        v2(0.05, 0.96),
        v2(0.07, 1.0),
        v2(0.0, 1.05),
    ];
    parts.add(
        glass("clear", 1.52, 0.0),
        [figure(&pawn, v3(-0.15, 0.008, 0.45))],
    );
    parts.add(
        tinted_glass("green", 1.5, 0.0, v3(2.5, 0.4, 1.6)),
        [figure(&bishop, v3(-0.65, 0.008, 0.0))],
    );
    parts.add(
        tinted_glass("amber", 1.6, 0.06, v3(0.2, 1.2, 3.5)),
        [figure(&pawn, v3(0.75, 0.008, 0.25))],
    );
    parts.add(
        metal("pewter", IRON, 0.18),
        [figure(&bishop, v3(0.3, 0.008, -0.3))],
    );
    parts.add_camera([0.0, 1.0, 4.0], [0.0, 0.42, 0.0], 30.0);
    parts
}

/// Blobs of coloured metal and a faceted ball under coloured lights.
pub(super) fn disco() -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        shapes::room(v3(-1.8, 0.0, -1.8), v3(1.8, 2.6, 2.4));
    parts.add(
        diffuse("walls", v3(0.55, 0.52, 0.58)),
        [left, right, ceiling, back, front],
    );
    parts.add(coated("lacquer", v3(0.25, 0.12, 0.2), 0.18), [floor]);
    let lamps = [
        (v3(1.0, 0.35, 0.3), -1.2, 0.3),
        (v3(0.4, 1.0, 0.5), 0.1, 0.9),
        (v3(0.35, 0.5, 1.0), 1.2, -0.2),
    ];
    for (i, (colour, x, z)) in lamps.into_iter().enumerate() {
        parts.add(
            emitter(&format!("lamp {i}"), colour * 24.0),
            [light_panel(v3(x, 2.59, z), 0.4, 0.4)],
        );
    }
    let facets = Mesh {
        normals: Vec::new(),
        ..sphere(v3(0.0, 1.75, -0.3), 0.36, 2)
    };
    parts.add(metal("facets", ALUMINIUM, 0.01), [facets]);
    let kinds = [
        (v3(0.95, 0.5, 0.45), 0.02, v3(-0.9, 0.5, -0.5)),
        (v3(0.5, 0.75, 0.95), 0.08, v3(0.85, 0.45, -0.6)),
        (v3(0.95, 0.8, 0.4), 0.22, v3(0.1, 0.4, 0.35)),
        (v3(0.7, 0.9, 0.6), 0.42, v3(-0.75, 1.4, 0.2)),
    ];
    for (i, (f0, alpha, at)) in kinds.into_iter().enumerate() {
        let k = 2.5 + i as f64;
        let body = blob(3, |d| {
            0.36 + 0.05 * (k * d.x + 1.0).sin() + 0.05 * (k * d.y - 0.7 * k * d.z).sin()
        });
        parts.add(metal(&format!("blob {alpha}"), f0, alpha), [body.moved(at)]);
    }
    parts.add(
        metal("post", IRON, 0.3),
        [cylinder(0.1, 0.9, 32).moved(v3(1.3, 0.0, 0.6))],
    );
    parts.add_camera([0.2, 1.3, 2.3], [0.0, 0.95, -0.4], 68.0);
    parts
}
