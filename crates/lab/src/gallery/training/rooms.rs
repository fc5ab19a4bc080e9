//! Rooms tiled with every roughness. Paths between their walls hit the four roughness bins about equally often, so that
//! five vertices form every combination of bins.

use super::super::materials::{
    ALUMINIUM, COPPER, GOLD, SILVER, coated, diffuse, emitter, glass, metal,
};
use super::super::shapes::{Placing, blob, cuboid, cylinder, quad, sphere, torus};
use super::super::{light_panel, v3};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Material, Mesh, SceneParts};

/// Two tile materials for each of the four roughness bins.
fn tile_materials() -> [Material; 8] {
    [
        metal("tile 0.02", SILVER, 0.02),
        metal("tile 0.05", ALUMINIUM, 0.05),
        metal("tile 0.1", v3(0.93, 0.85, 0.75), 0.1),
        metal("tile 0.2", SILVER, 0.2),
        metal("tile 0.28", ALUMINIUM, 0.28),
        metal("tile 0.4", v3(0.8, 0.87, 0.93), 0.4),
        metal("tile 0.7", SILVER, 0.7),
        diffuse("tile 1", Rgb::splat(0.8)),
    ]
}

/// Covers each of the six walls of a room with `n` × `n` tiles, whose materials a fixed hash chooses.
fn tiled(parts: &mut SceneParts, min: Vec3, max: Vec3, n: u32, seed: u32) {
    let d = max - min;
    let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
    let walls = [
        (min, y, z),
        (max, -z, -y),
        (min, z, x),
        (max, -x, -z),
        (min, x, y),
        (max, -y, -x),
    ];
    let mut tiles: [Vec<Mesh>; 8] = Default::default();
    for (w, (corner, u, v)) in walls.into_iter().enumerate() {
        for i in 0..n * n {
            let (a, b) = ((i % n) as f32 / n as f32, (i / n) as f32 / n as f32);
            let kind = hash(seed + 1000 * w as u32 + i) as usize % 8;
            tiles[kind].push(quad(corner + a * u + b * v, u / n as f32, v / n as f32));
        }
    }
    for (material, tiles) in tile_materials().into_iter().zip(tiles) {
        parts.add(material, [Mesh::joined(tiles)]);
    }
}

fn hash(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Metal, glass and coated bodies of every roughness bin in a tiled room.
pub(super) fn many_roughnesses() -> SceneParts {
    let mut parts = SceneParts::default();
    tiled(&mut parts, v3(-1.5, 0.0, -1.5), v3(1.5, 2.4, 1.5), 6, 7);
    parts.add(
        emitter("lights", v3(1.0, 0.96, 0.9) * 6.0),
        [
            light_panel(v3(-0.6, 2.39, 0.2), 0.6, 0.6),
            light_panel(v3(0.7, 2.39, -0.5), 0.6, 0.6),
        ],
    );
    let ball = |x: f32, z: f32, r: f32| sphere(v3(x, r + 0.002, z), r, 3);
    parts.add(glass("glass 0", 1.5, 0.0), [ball(-0.8, 0.1, 0.32)]);
    parts.add(glass("glass 0.12", 1.5, 0.12), [ball(0.1, 0.55, 0.26)]);
    parts.add(glass("glass 0.33", 1.5, 0.33), [ball(0.95, -0.1, 0.3)]);
    parts.add(metal("gold 0.01", GOLD, 0.01), [ball(0.3, -0.5, 0.36)]);
    let lumpy = blob(3, |d| 0.3 + 0.04 * (6.0 * d.x + 4.0 * d.z).sin());
    parts.add(
        metal("copper 0.33", COPPER, 0.33),
        [lumpy.moved(v3(-0.55, 0.34, -0.85))],
    );
    parts.add(
        metal("silver 0.12", SILVER, 0.12),
        [torus(0.26, 0.08, 48, 16).moved(v3(-0.45, 0.082, 0.75))],
    );
    for (x, z, alpha) in [(-1.2, -0.4, 0.01), (0.75, 0.65, 0.12), (0.95, -0.95, 0.33)] {
        let pillar = cuboid(v3(-0.16, 0.0, -0.16), v3(0.16, 0.7, 0.16));
        parts.add(
            coated(&format!("coat {alpha}"), v3(0.5, 0.25, 0.2), alpha),
            [pillar.placed([0.5 + x, 0.0, 0.0], v3(x, 0.0, z))],
        );
    }
    parts.add_camera([0.0, 1.25, 1.45], [0.0, 0.75, -0.6], 75.0);
    parts
}

/// Panes and balls of glass from clear to frosted in a smaller tiled room.
pub(super) fn frosted_panes() -> SceneParts {
    let mut parts = SceneParts::default();
    tiled(&mut parts, v3(-1.2, 0.0, -1.4), v3(1.2, 2.0, 1.4), 5, 99);
    parts.add(
        emitter("lights", v3(0.95, 0.97, 1.0) * 7.0),
        [
            light_panel(v3(0.0, 1.99, -0.9), 0.6, 0.5),
            light_panel(v3(0.2, 1.99, 0.5), 0.5, 0.5),
        ],
    );
    for (i, alpha) in [0.0, 0.04, 0.15, 0.33, 0.6].into_iter().enumerate() {
        let pane = cuboid(v3(-0.22, 0.0, -0.03), v3(0.22, 1.0, 0.03));
        let x = -0.88 + 0.44 * i as f32;
        let z = if i % 2 == 0 { -0.35 } else { -0.05 };
        parts.add(
            glass(&format!("pane {alpha}"), 1.5, alpha),
            [pane.placed([0.25, 0.0, 0.0], v3(x, 0.002, z))],
        );
        let ball = sphere(v3(x, 0.152, 0.45 + 0.1 * (i as f32 % 2.0)), 0.15, 3);
        parts.add(glass(&format!("ball {alpha}"), 1.45, alpha), [ball]);
    }
    parts.add(
        metal("rod", COPPER, 0.25),
        [cylinder(0.08, 1.3, 32).moved(v3(0.3, 0.0, -0.9))],
    );
    parts.add(
        metal("mirror ball", SILVER, 0.015),
        [sphere(v3(-0.4, 0.352, -0.95), 0.35, 3)],
    );
    parts.add_camera([0.0, 1.2, 1.35], [0.0, 0.6, -0.5], 75.0);
    parts
}
