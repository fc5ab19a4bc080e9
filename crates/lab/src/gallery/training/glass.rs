//! Glass: bodies inside bodies, and a lamp behind glass.

use super::super::materials::{ALUMINIUM, GOLD, coated, diffuse, emitter, glass, metal};
use super::super::shapes::{self, Placing, blob, curve, cylinder, quad, revolve, sphere};
use super::super::{v2, v3};
use super::boxes::caustic_box;
use opsr::math::{Rgb, Vec3};
use opsr::scene::SceneParts;

/// A hollow glass ball with a ball inside, a decanter, frosted balls.
pub(super) fn glass_in_glass() -> SceneParts {
    let mut parts = caustic_box(v3(-0.6, 1.7, -0.75), 0.34, 27.0);
    let centre = v3(0.45, 0.52, 0.0);
    parts.add(
        glass("glass", 1.5, 0.0),
        [
            sphere(centre, 0.44, 4),
            sphere(centre, 0.37, 3).inverted(),
            sphere(centre, 0.24, 3),
        ],
    );
    let outside = [
        v2(0.0, 0.0),
        v2(0.27, 0.0),
        v2(0.35, 0.1),
        v2(0.33, 0.3),
        v2(0.16, 0.58),
        v2(0.08, 0.78),
        v2(0.1, 0.98),
        v2(0.14, 1.05),
        v2(0.12, 1.06),
        v2(0.055, 0.96),
        v2(0.045, 0.78),
        v2(0.12, 0.57),
        v2(0.28, 0.29),
        v2(0.29, 0.12),
        v2(0.22, 0.06),
        v2(0.0, 0.06),
    ];
    parts.add(
        glass("decanter", 1.55, 0.01),
        [revolve(&curve(&outside, 3), false, 48).moved(v3(-0.45, 0.01, -0.15))],
    );
    parts.add(
        glass("frosted", 1.5, 0.12),
        [sphere(v3(-0.05, 0.22, 0.5), 0.17, 3)],
    );
    parts.add(
        glass("rough", 1.4, 0.3),
        [sphere(v3(-0.68, 0.142, 0.55), 0.14, 3)],
    );
    parts
}

/// A desk lamp: a glowing ball in a glass bulb, under a shade of brushed metal, over a lacquered table.
pub(super) fn bulb_lamp() -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, _] =
        shapes::room(v3(-1.3, 0.0, -1.0), v3(1.3, 2.1, 1.2));
    parts.add(diffuse("plaster", Rgb::splat(0.75)), [ceiling, back, left]);
    parts.add(diffuse("blue", v3(0.15, 0.25, 0.5)), [right]);
    parts.add(coated("lacquer", v3(0.35, 0.2, 0.1), 0.06), [floor]);
    let bulb = v3(0.0, 0.85, -0.2);
    parts.add(
        emitter("filament", v3(1.0, 0.85, 0.6) * 10.3),
        [sphere(bulb, 0.175, 2)],
    );
    // Ribbed outside and smooth inside: it projects bands of light on all walls.
    let ribbed = blob(4, |d| {
        0.275
            + 0.008 * (14.0 * d.y).sin()
            + 0.006 * (8.0 * d.z.atan2(d.x)).sin() * (1.0 - d.y * d.y)
    });
    parts.add(
        glass("bulb", 1.5, 0.0),
        [ribbed.moved(bulb), sphere(bulb, 0.22, 3).inverted()],
    );
    let shade = [v2(0.5, 1.15), v2(0.52, 1.15), v2(0.36, 1.4), v2(0.34, 1.4)];
    parts.add(
        metal("shade", ALUMINIUM, 0.25),
        [revolve(&shade, true, 64).moved(Vec3::Z * -0.2)],
    );
    parts.add(
        metal("stand", GOLD, 0.12),
        [
            cylinder(0.04, 0.66, 32).moved(Vec3::Z * -0.2),
            cylinder(0.22, 0.04, 48).moved(Vec3::Z * -0.2),
        ],
    );
    parts.add(
        glass("ball", 1.5, 0.0),
        [sphere(v3(0.62, 0.202, 0.35), 0.2, 3)],
    );
    let lumpy = blob(3, |d| 0.19 + 0.03 * (7.0 * d.x + 5.0 * d.y).sin());
    parts.add(
        metal("gold", GOLD, 0.05),
        [lumpy.moved(v3(-0.6, 0.23, 0.4))],
    );
    parts.add(
        diffuse("paper", Rgb::splat(0.8)),
        [quad(v3(-0.25, 0.003, 0.35), Vec3::Z * 0.55, Vec3::X * 0.5)],
    );
    parts.add_camera([0.0, 1.5, 2.9], [0.0, 0.5, 0.0], 42.0);
    parts
}
