//! Scenes with the kinds of paths that the papers' figures show.

use super::materials::{GOLD, SILVER, coated, diffuse, emitter, glass, metal};
use super::shapes::{Placing, cuboid, cylinder, height_field, quad, room, sphere, torus};
use super::{open_box, v2, v3};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{Material, Mesh, PunctualLight, SceneParts};

/// A torus of rough gold inside a cube of smooth glass, under a small lamp. Light reaches the torus, and the camera
/// sees it, only through the glass. `[UPS]` Fig. 15.
pub(super) fn torus_in_glass() -> SceneParts {
    let mut parts = open_box(0.1, 300.0);
    let turn = [0.4, 0.0, 0.0];
    let cube = cuboid(v3(-0.5, 0.0, -0.5), v3(0.5, 1.0, 0.5));
    let at = v3(0.0, 0.01, 0.1);
    parts.add(glass("cube", 1.5, 0.0), [cube.placed(turn, at)]);
    let torus = torus(0.28, 0.12, 96, 48).placed([0.4, 1.1, 0.0], at + v3(0.0, 0.5, 0.0));
    parts.add(metal("torus", GOLD, 0.1), [torus]);
    parts
}

/// Lights of a panel: the number in `[PSR]` Figs. 1 and 6.
const LEDS: usize = 4_194;

/// Three letters of five by seven cells each.
const LETTERS: [&str; 7] = [
    "####. .#### ####.",
    "#...# #.... #...#",
    "#...# #.... #...#",
    "####. .###. ####.",
    "#.... ....# #.#..",
    "#.... ....# #..#.",
    "#.... ####. #...#",
];

/// Radiant intensity of all lights of a panel.
const PANEL: Rgb = v3(7.0, 6.4, 5.6);

/// Positions of the lights of a panel of this width around `at`: readable from +z, or from −z in a mirror.
fn leds(at: Vec3, width: f32) -> Vec<Vec3> {
    // Lights along a side of a cell, and cells in a line.
    let (side, cells) = (10, 17);
    let mut places = Vec::new();
    for (row, line) in LETTERS.iter().enumerate() {
        for (column, _) in line.bytes().enumerate().filter(|&(_, cell)| cell == b'#') {
            for i in 0..side * side {
                let x = (column * side + i % side) as f32 + 0.5 - 0.5 * (cells * side) as f32;
                let y = 0.5 * (LETTERS.len() * side) as f32 - (row * side + i / side) as f32 - 0.5;
                places.push((x, y));
            }
        }
    }
    let pitch = width / (cells * side) as f32;
    (0..LEDS)
        .map(|i| places[i * places.len() / LEDS])
        .map(|(x, y)| at + v3(pitch * x, pitch * y, 0.0))
        .collect()
}

/// Kind of the lights of a panel.
#[derive(Clone, Copy)]
pub(super) enum Led {
    /// Points: no path of the camera can find their mirror image.
    Point,
    /// Small balls of the same intensity, which approximate the mirror image of the points.
    Ball,
}

/// Radius of a light that is a ball.
const BALL: f32 = 0.003;

impl Led {
    fn add(self, parts: &mut SceneParts, places: Vec<Vec3>) {
        let intensity = PANEL / LEDS as f32;
        match self {
            Self::Point => {
                let light = |position| PunctualLight::Point {
                    position,
                    intensity,
                    range: f32::INFINITY,
                };
                parts.lights.extend(places.into_iter().map(light));
            }
            Self::Ball => {
                let ball = Mesh {
                    normals: Vec::new(),
                    ..sphere(Vec3::ZERO, BALL, 0)
                };
                let corner = |i: u32| ball.positions[i as usize];
                let area = |&[a, b, c]: &[u32; 3]| {
                    0.5 * (corner(b) - corner(a))
                        .cross(corner(c) - corner(a))
                        .length()
                };
                // The projected area of a convex body is on average a quarter of its surface.
                let shown = 0.25 * ball.indices.iter().map(area).sum::<f32>();
                let balls = places.into_iter().map(|at| ball.clone().moved(at));
                parts.add(emitter("leds", intensity / shown), [Mesh::joined(balls)]);
            }
        }
    }
}

/// A bathroom lit by a panel of thousands of small lights, which the camera sees in a mirror. `[PSR]` Fig. 1.
pub(super) fn panel_in_mirror(led: Led) -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] = room(v3(-1.5, 0.0, -1.5), v3(1.5, 2.4, 1.5));
    let walls = diffuse("walls", v3(0.7, 0.72, 0.7));
    parts.add(walls, [left, right, ceiling, back, front]);
    parts.add(diffuse("floor", v3(0.3, 0.32, 0.4)), [floor]);
    let mirror = quad(v3(-1.0, 0.95, -1.49), Vec3::X * 2.0, Vec3::Y * 1.25);
    parts.add(metal("mirror", SILVER, 0.0), [mirror]);
    let basin = cuboid(v3(-0.5, 0.0, -1.499), v3(0.9, 0.8, -1.0));
    parts.add(diffuse("basin", Rgb::splat(0.75)), [basin]);
    parts.add(
        glass("ball", 1.5, 0.0),
        [sphere(v3(-0.2, 0.921, -1.2), 0.12, 4)],
    );
    let brass = cylinder(0.05, 0.25, 48).moved(v3(0.45, 0.801, -1.25));
    parts.add(metal("brass", GOLD, 0.1), [brass]);
    let board = cuboid(v3(-0.5, 1.35, 1.45), v3(1.5, 2.25, 1.499));
    parts.add(diffuse("board", Rgb::splat(0.005)), [board]);
    led.add(&mut parts, leds(v3(0.5, 1.8, 1.43), 1.8));
    parts.add_camera([-0.5, 1.45, 0.7], [0.1, 1.3, -1.5], 52.0);
    parts
}

/// A panel of thousands of small lights over waves of water, visible only by reflection in the water. `[PSR]` Fig. 6.
pub(super) fn panel_over_water(led: Led) -> SceneParts {
    let mut parts = SceneParts::default();
    let waves =
        |x: f64, z: f64| 0.012 * ((5.0 * x + 3.0 * z).sin() + (7.0 * z - 4.0 * x + 1.0).sin());
    let surface = height_field(v2(-2.5, -3.0), v2(2.5, 3.0), [96, 96], waves);
    let water = Material {
        ior: 1.33,
        ..coated("water", v3(0.02, 0.05, 0.07), 0.0)
    };
    parts.add(water, [surface]);
    led.add(&mut parts, leds(v3(0.0, 1.0, -2.0), 2.2));
    parts.add_camera([0.0, 1.3, 3.2], [0.0, -0.05, 0.6], 36.0);
    parts
}
