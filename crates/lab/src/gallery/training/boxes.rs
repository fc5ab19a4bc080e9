//! Cornell boxes full of caustics.

use super::super::materials::{ALUMINIUM, COPPER, diffuse, emitter, glass, metal};
use super::super::shapes::{self, Placing, cuboid, prism, quad, ring, sphere};
use super::super::{v2, v3};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Material, Mesh, SceneParts};

/// Polished copper ring, glass ball, and a prism on a diffuse block.
pub(super) fn cornell_caustics() -> SceneParts {
    furnished(
        metal("copper", COPPER, 0.0),
        diffuse("block", Rgb::splat(0.7)),
        glass("prism", 1.6, 0.0),
    )
}

/// The same with metals of roughness 0.05 and 0.15, and a prism of 0.05.
pub(super) fn cornell_glossy() -> SceneParts {
    furnished(
        metal("copper", COPPER, 0.05),
        metal("block", ALUMINIUM, 0.15),
        glass("prism", 1.6, 0.05),
    )
}

fn furnished(ring_metal: Material, block: Material, prism_glass: Material) -> SceneParts {
    let mut parts = caustic_box(v3(0.7, 1.6, -0.75), 0.26, 46.0);
    parts.add(
        glass("ball", 1.5, 0.0),
        [sphere(v3(0.45, 0.45, 0.2), 0.33, 4)],
    );
    parts.add(
        ring_metal,
        [ring(0.36, 0.03, 0.28, 96).moved(v3(-0.42, 0.0, 0.42))],
    );
    parts.add(
        block,
        [cuboid(v3(-0.26, 0.0, -0.22), v3(0.26, 0.5, 0.22))
            .placed([0.35, 0.0, 0.0], v3(-0.5, 0.0, -0.45))],
    );
    let triangle = [v2(-0.2, 0.0), v2(0.2, 0.0), v2(0.0, 0.34)];
    parts.add(
        prism_glass,
        [prism(&triangle, 0.36).placed([0.9, 0.0, 0.0], v3(0.0, 0.004, 0.0))],
    );
    parts
}

/// The open box with a small light near the back, so that caustics fall to the front, and a camera that looks down on
/// them.
pub(super) fn caustic_box(light: Vec3, edge: f32, radiance: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, _] =
        shapes::room(v3(-1.0, 0.0, -1.0), v3(1.0, 2.0, 1.4));
    parts.add(diffuse("white", Rgb::splat(0.73)), [floor, ceiling, back]);
    parts.add(diffuse("red", v3(0.6, 0.06, 0.05)), [left]);
    parts.add(diffuse("green", v3(0.13, 0.45, 0.1)), [right]);
    parts.add(
        emitter("light", v3(1.0, 0.92, 0.8) * radiance),
        [lamp(light, v3(0.0, 0.2, 0.2), edge)],
    );
    parts.add_camera([0.0, 1.75, 2.5], [0.0, 0.2, 0.25], 42.0);
    parts
}

/// A square light at `at` that faces `to`.
pub(super) fn lamp(at: Vec3, to: Vec3, edge: f32) -> Mesh {
    let (u, v) = (to - at).normalize().any_orthonormal_pair();
    quad(at - 0.5 * edge * (u + v), u * edge, v * edge)
}
