//! Metals: rings before a mirror, and a corridor of long glossy chains.

use super::super::materials::{ALUMINIUM, COPPER, GOLD, SILVER, coated, diffuse, emitter, metal};
use super::super::shapes::{self, Placing, cylinder, quad, ring, torus};
use super::super::{light_panel, v3};
use super::boxes::lamp;
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Mesh, SceneParts};

/// Six rings from polished to rough on a white floor, a mirror behind them.
pub(super) fn rings() -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        shapes::room(v3(-1.5, 0.0, -1.1), v3(1.5, 2.0, 2.9));
    parts.add(diffuse("white", Rgb::splat(0.75)), [floor, ceiling, front]);
    parts.add(diffuse("ochre", v3(0.6, 0.4, 0.15)), [left]);
    parts.add(diffuse("teal", v3(0.1, 0.4, 0.42)), [right]);
    parts.add(metal("mirror", SILVER, 0.0), [back]);
    parts.add(
        emitter("light", v3(1.0, 0.95, 0.85) * 45.0),
        [lamp(v3(-1.2, 1.5, 1.3), v3(0.0, 0.1, 0.0), 0.3)],
    );
    let kinds = [
        (GOLD, 0.005),
        (COPPER, 0.03),
        (SILVER, 0.1),
        (GOLD, 0.2),
        (COPPER, 0.35),
        (SILVER, 0.6),
    ];
    for (i, (f0, alpha)) in kinds.into_iter().enumerate() {
        let at = v3(i as f32 % 3.0 - 1.0, 0.0, if i < 3 { 0.5 } else { -0.45 });
        let body = match i % 2 {
            0 => ring(0.36, 0.03, 0.24, 64),
            _ => torus(0.33, 0.09, 48, 16).moved(Vec3::Y * 0.091),
        };
        parts.add(
            metal(&format!("ring {alpha}"), f0, alpha),
            [body.moved(0.95 * at)],
        );
    }
    parts.add_camera([0.0, 1.5, 2.8], [0.0, 0.3, -0.1], 48.0);
    parts
}

/// A closed corridor whose walls are panels of metal of changing roughness, lit from the ceiling and from its end.
pub(super) fn corridor() -> SceneParts {
    let mut parts = SceneParts::default();
    let [_, _, floor, ceiling, back, front] = shapes::room(v3(-0.8, 0.0, -5.0), v3(0.8, 1.6, 1.0));
    parts.add(coated("floor", v3(0.3, 0.22, 0.16), 0.12), [floor]);
    parts.add(diffuse("ceiling", Rgb::splat(0.7)), [ceiling, front]);
    parts.add(metal("end", ALUMINIUM, 0.02), [back]);
    let kinds = [
        (ALUMINIUM, 0.03),
        (COPPER, 0.14),
        (SILVER, 0.3),
        (GOLD, 0.04),
    ];
    for (k, (f0, alpha)) in kinds.into_iter().enumerate() {
        // Panels of unit length. The right wall is shifted by two panels, so that different ones face each other.
        let left = (0..6)
            .filter(|i| i % 4 == k)
            .map(|i| quad(v3(-0.8, 0.0, -(i as f32)), Vec3::Y * 1.6, Vec3::Z));
        let right = (0..6)
            .filter(|i| (i + 2) % 4 == k)
            .map(|i| quad(v3(0.8, 1.6, 1.0 - i as f32), Vec3::Z * -1.0, Vec3::Y * -1.6));
        let all = Mesh::joined(left.chain(right));
        parts.add(metal(&format!("panel {alpha}"), f0, alpha), [all]);
    }
    parts.add(
        emitter("lights", v3(1.0, 0.93, 0.85) * 10.0),
        [0.0, -2.2, -4.2].map(|z| light_panel(v3(0.0, 1.595, z), 0.5, 0.5)),
    );
    parts.add(
        metal("columns", GOLD, 0.08),
        [
            cylinder(0.14, 1.2, 48).moved(v3(-0.42, 0.0, -1.3)),
            cylinder(0.14, 0.8, 48).moved(v3(0.42, 0.0, -0.7)),
        ],
    );
    parts.add(
        metal("rough column", ALUMINIUM, 0.4),
        [cylinder(0.16, 1.0, 48).moved(v3(0.4, 0.0, -2.6))],
    );
    parts.add_camera([0.1, 0.9, 0.9], [0.0, 0.62, -2.0], 62.0);
    parts
}
