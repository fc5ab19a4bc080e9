//! Scenes that are hard for one estimator and easy for another.

use super::materials::{GOLD, SILVER, coated, diffuse, emitter, glass, metal, translucent};
use super::shapes::{Placing, cuboid, cylinder, disc, quad, revolve, room, sphere};
use super::{caustic_box, open_box, v3};
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::{Environment, Mesh, PunctualLight, SceneParts};
use std::f32::consts::PI;

/// The caustic box with a small light, behind a pane of smooth glass: light and camera both reach its caustics only
/// through Dirac lobes.
pub(super) fn caustic_behind_glass() -> SceneParts {
    let mut parts = caustic_box();
    let light = parts.materials.iter().position(|m| m.name == "light");
    let light = light.expect("a light") as u32;
    // The light's edge becomes 0.1 instead of 0.4, at equal power.
    parts.materials[light as usize].emission *= 16.0;
    for mesh in parts.meshes.iter_mut().filter(|m| m.material == light) {
        mesh.positions
            .iter_mut()
            .for_each(|p| (p.x, p.z) = (0.25 * p.x, 0.25 * p.z));
    }
    let pane = cuboid(v3(-1.2, -0.2, 1.2), v3(1.2, 2.2, 1.25));
    parts.add(glass("pane", 1.5, 0.0), [pane]);
    parts
}

/// A filament in a bulb of smooth glass in a closed room, with a mirror on the left wall.
pub(super) fn filament() -> SceneParts {
    let mut parts = SceneParts::default();
    let walls = room(v3(-1.0, 0.0, -1.0), v3(1.0, 2.0, 1.5));
    parts.add(diffuse("walls", v3(0.7, 0.65, 0.55)), walls);
    let at = v3(0.3, 1.3, -0.2);
    let (outer, inner) = (sphere(at, 0.22, 5), sphere(at, 0.2, 5).inverted());
    parts.add(glass("bulb", 1.5, 0.0), [outer, inner]);
    parts.add(
        emitter("filament", v3(1.0, 0.8, 0.5) * 900.0),
        [sphere(at, 0.02, 2)],
    );
    let mirror = quad(v3(-0.99, 0.5, 0.9), Vec3::Z * -1.4, Vec3::Y * 1.1);
    parts.add(metal("mirror", SILVER, 0.0), [mirror]);
    let block = cuboid(v3(-0.3, 0.0, -0.6), v3(0.1, 0.6, -0.2));
    parts.add(diffuse("block", Rgb::splat(0.6)), [block]);
    parts.add_camera([0.6, 1.1, 1.4], [-0.2, 0.85, -0.4], 70.0);
    parts
}

/// A bulb in a paper shade on a table, beside a leaf in a glass of water and a brass bowl: most light passes the paper.
pub(super) fn shaded_lamp() -> SceneParts {
    let mut parts = SceneParts::default();
    let walls = room(v3(-1.2, 0.0, -0.9), v3(1.2, 1.8, 1.8));
    parts.add(diffuse("walls", v3(0.62, 0.6, 0.55)), walls);
    let top = cuboid(v3(-0.9, 0.0, -0.6), v3(0.9, 0.7, 0.4));
    parts.add(coated("table", v3(0.35, 0.2, 0.12), 0.2), [top]);
    let bulb = v3(-0.3, 1.12, -0.15);
    let turned = |profile: &[Vec2]| revolve(profile, false, 48);
    let at = |mesh: Mesh, place: Vec3| mesh.placed([0.0; 3], place);
    let shade = turned(&[Vec2::new(0.2, 0.98), Vec2::new(0.12, 1.28)]);
    let paper = diffuse("paper", v3(0.8, 0.76, 0.66));
    parts.add(
        translucent(paper, 0.45, v3(0.9, 0.78, 0.55)),
        [at(shade, bulb.with_y(0.0))],
    );
    let foot = at(cylinder(0.015, 0.35, 24), bulb.with_y(0.7));
    parts.add(metal("foot", v3(0.8, 0.65, 0.4), 0.1), [foot]);
    parts.add(
        emitter("bulb", v3(1.0, 0.85, 0.6) * 220.0),
        [sphere(bulb, 0.035, 3)],
    );
    let bowl = turned(&[
        Vec2::new(0.0, 0.701),
        Vec2::new(0.09, 0.701),
        Vec2::new(0.13, 0.78),
        Vec2::new(0.125, 0.78),
        Vec2::new(0.085, 0.711),
        Vec2::new(0.0, 0.711),
    ]);
    parts.add(metal("brass", GOLD, 0.08), [at(bowl, v3(0.12, 0.0, 0.18))]);
    let water = at(cylinder(0.06, 0.16, 48), v3(0.36, 0.701, -0.05));
    parts.add(glass("water", 1.33, 0.0), [water]);
    let leaf = blade(v3(0.37, 0.84, -0.05), 0.34);
    let green = coated("leaf", v3(0.1, 0.22, 0.05), 0.3);
    parts.add(translucent(green, 0.5, v3(0.35, 0.6, 0.08)), [leaf]);
    parts.add_camera([0.35, 1.25, 1.35], [0.02, 0.92, -0.1], 50.0);
    parts
}

/// A leaf of this length without thickness, bent towards the lamp.
fn blade(root: Vec3, length: f32) -> Mesh {
    const STEPS: u32 = 16;
    let mut mesh = Mesh::default();
    for i in 0..=STEPS {
        let t = i as f32 / STEPS as f32;
        let spine = root + length * v3(-0.45 * t, t - 0.5 * t * t, 0.15 * t);
        let half = 0.17 * length * (PI * (0.08 + 0.92 * t)).sin();
        for side in [-1.0, 0.0, 1.0f32] {
            let fold = 0.25 * side.abs() * half;
            mesh.positions.push(spine + v3(0.0, fold, side * half));
        }
        if i > 0 {
            let k = 3 * i;
            for j in [k, k + 1] {
                mesh.indices.push([j - 3, j - 2, j + 1]);
                mesh.indices.push([j - 3, j + 1, j]);
            }
        }
    }
    super::shapes::smooth(&mut mesh);
    mesh
}

/// Cells along a side of the water's surface.
const WAVES: u32 = 64;

/// Direction and irradiance of the sun over the pools.
const SUNSHINE: (Vec3, Rgb) = (v3(0.35, -1.0, -0.2), v3(4.0, 3.8, 3.4));

/// The pool under a sun without extent, which plain path tracing cannot find through the water.
pub(super) fn sun_pool() -> SceneParts {
    let mut parts = pool();
    parts.lights.push(PunctualLight::Directional {
        direction: SUNSHINE.0.normalize(),
        irradiance: SUNSHINE.1,
    });
    parts
}

/// Distance and angular radius of the sun's disc.
const FAR: f32 = 60.0;
const HALF_ANGLE: f32 = 0.75 * PI / 180.0;

/// The pool under a disc of 1.5 degrees, which plain path tracing finds only by chance: one path in thousands.
pub(super) fn pool_in_the_sun() -> SceneParts {
    under_disc(pool())
}

/// The pool with water of another depth, from above.
pub(super) fn pool_of(depth: f32) -> SceneParts {
    let mut parts = water_of(depth);
    parts.add_camera([0.0, 3.6, 1.2], [0.0, LEVEL - 0.5 * depth, 0.0], 40.0);
    under_disc(parts)
}

/// A scene under a disc of 1.5 degrees.
fn under_disc(mut parts: SceneParts) -> SceneParts {
    let towards = -SUNSHINE.0.normalize();
    let turned = |v: Vec3| {
        // The rotation from the disc's axis to the direction of its light.
        let axis = Vec3::Y.cross(-towards);
        v + axis.cross(v) + axis.cross(axis.cross(v)) / (1.0 - Vec3::Y.dot(towards))
    };
    let mut sun = disc(FAR * HALF_ANGLE.tan(), 32);
    let positions = sun.positions.iter_mut();
    positions.for_each(|p| *p = turned(*p) + FAR * towards);
    sun.normals.iter_mut().for_each(|n| *n = turned(*n));
    sun.tangents.clear();
    let radiance = SUNSHINE.1 / (PI * HALF_ANGLE.sin().powi(2));
    parts.add(emitter("sun", radiance), [sun]);
    parts
}

/// A tiled pool under a dim sky, seen through the smooth surface of its water: sunlit paths cross it twice.
fn pool() -> SceneParts {
    let mut parts = water_of(LEVEL);
    parts.add_camera([0.0, 2.3, 2.0], [0.0, 0.3, 0.0], 42.0);
    parts
}

/// Height of the surface of the water.
const LEVEL: f32 = 0.8;

/// The pool with water of this depth, without camera.
fn water_of(depth: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let (low, high) = (v3(-1.0, LEVEL - depth, -1.0), v3(1.0, LEVEL, 1.0));
    let [left, right, floor, _, back, front] = room(low + 0.01, high - v3(0.01, -0.1, 0.01));
    let tiles = diffuse("tiles", v3(0.5, 0.7, 0.75));
    parts.add(tiles, [left, right, floor, back, front]);
    let mut body = cuboid(low, high);
    // Without its upper side, which the waves replace.
    body.indices.drain(6..8);
    parts.add(glass("water", 1.33, 0.0), [body, waves(low, high)]);
    let radius = f32::min(0.25, 0.35 * depth);
    let ball = sphere(v3(0.3, low.y + 0.01 + radius, -0.2), radius, 4);
    parts.add(diffuse("ball", v3(0.8, 0.35, 0.2)), [ball]);
    parts.environment = Some(Environment::constant(v3(0.1, 0.13, 0.2)));
    parts
}

/// The upper side of a body of water, with gentle waves that end at its edges.
fn waves(low: Vec3, high: Vec3) -> Mesh {
    let n = WAVES + 1;
    let at = |i: u32| {
        let (x, z) = (f64::from(i % n), f64::from(i / n));
        let (x, z) = (x / f64::from(WAVES), z / f64::from(WAVES));
        let bump = |a: f64, b: f64, phase: f64| (a * x + b * z + phase).sin();
        let edge = (16.0 * x * (1.0 - x) * z * (1.0 - z)).min(1.0);
        let sum = bump(17.0, 5.0, 0.3) + bump(-7.0, 19.0, 1.1) + bump(11.0, -13.0, 2.0);
        let side = high - low;
        v3(
            low.x + side.x * x as f32,
            high.y + (0.008 * edge * sum) as f32,
            low.z + side.z * z as f32,
        )
    };
    let positions: Vec<Vec3> = (0..n * n).map(at).collect();
    let corner = |x: u32, z: u32| z * n + x;
    let indices: Vec<[u32; 3]> = (0..WAVES * WAVES)
        .flat_map(|i| {
            let (x, z) = (i % WAVES, i / WAVES);
            let [a, b] = [corner(x, z), corner(x, z + 1)];
            [[a, b, b + 1], [a, b + 1, a + 1]]
        })
        .collect();
    let mut mesh = Mesh {
        positions,
        indices,
        ..Mesh::default()
    };
    super::shapes::smooth(&mut mesh);
    mesh
}

/// A diffuse, a glossy and a glass box under a small light: `[UPS]` Fig. 13.
pub(super) fn three_boxes() -> SceneParts {
    let mut parts = open_box(0.1, 300.0);
    let block = |w: f32, h: f32| cuboid(v3(-w, 0.0, -w), v3(w, h, w));
    let placed =
        |mesh: Mesh, turn: f32, x: f32, z: f32| mesh.placed([turn, 0.0, 0.0], v3(x, 0.01, z));
    parts.add(
        diffuse("box", Rgb::splat(0.7)),
        [placed(block(0.22, 0.5), 0.3, -0.6, 0.3)],
    );
    parts.add(
        metal("glossy", SILVER, 0.05),
        [placed(block(0.26, 1.1), -0.4, -0.1, -0.5)],
    );
    parts.add(
        glass("glass", 1.5, 0.0),
        [placed(block(0.25, 0.6), 0.5, 0.5, 0.3)],
    );
    parts
}

/// Two rooms with a door ajar between them: all light in the visible room comes through the gap, from a lamp that faces
/// the other room's ceiling. After Veach.
pub(super) fn door_ajar() -> SceneParts {
    let mut parts = SceneParts::default();
    let (low, high) = (v3(-2.0, 0.0, -1.5), v3(2.0, 2.2, 1.5));
    parts.add(diffuse("walls", v3(0.75, 0.72, 0.65)), room(low, high));
    // The wall between the rooms, with an opening from z = −0.5 to 0.4 and a lintel.
    let part = |z: [f32; 2], y: [f32; 2]| cuboid(v3(-0.05, y[0], z[0]), v3(0.05, y[1], z[1]));
    let wall = [
        part([-1.5, -0.5], [0.0, 2.2]),
        part([0.4, 1.5], [0.0, 2.2]),
        part([-0.5, 0.4], [1.8, 2.2]),
    ];
    parts.add(diffuse("wall", v3(0.6, 0.65, 0.7)), wall);
    let door = cuboid(v3(-0.025, 0.0, 0.0), v3(0.025, 1.79, 0.9));
    parts.add(
        diffuse("door", v3(0.45, 0.3, 0.18)),
        [door.placed([-0.05, 0.0, 0.0], v3(0.0, 0.0, -0.5))],
    );
    // The lamp faces the ceiling.
    let lamp = quad(v3(1.2, 1.4, -0.2), Vec3::Z * 0.4, Vec3::X * 0.4);
    parts.add(emitter("lamp", v3(1.0, 0.9, 0.75) * 2000.0), [lamp]);
    parts.add(
        coated("table", v3(0.4, 0.25, 0.15), 0.15),
        [cuboid(v3(-1.6, 0.0, -0.7), v3(-0.8, 0.5, 0.3))],
    );
    let ball = |x: f32, z: f32| sphere(v3(x, 0.68, z), 0.18, 4);
    parts.add(metal("gold", GOLD, 0.05), [ball(-1.35, -0.4)]);
    parts.add(glass("glass", 1.5, 0.0), [ball(-1.1, 0.05)]);
    parts.add_camera([-1.75, 1.2, 1.3], [-0.5, 0.75, -0.6], 68.0);
    parts
}
