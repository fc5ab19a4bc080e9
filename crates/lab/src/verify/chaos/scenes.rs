//! Random small scenes: a room or open ground, bodies of all materials, lights of all kinds.

use super::Numbers;
use crate::gallery::materials::{
    brushed, clearcoated, coated, diffuse, emitter, glass, metal, tinted_glass,
};
use crate::gallery::shapes::{Placing, cuboid, cylinder, disc, quad, ring, room, sphere, torus};
use opsr::math::{Rgb, Vec3};
use opsr::scene::finish::FilmCover;
use opsr::scene::{
    AlphaMode, Environment, Lens, Material, Medium, Mesh, PunctualLight, SceneParts,
};
use std::f32::consts::TAU;

/// Kinds of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// All features.
    Any,
    /// Only light that every estimator except light tracing finds quickly: lights with an area and no sharp lobes
    /// except Dirac ones, or lights without an area and rough lobes.
    Found {
        /// True for lights without an area.
        punctual: bool,
    },
}

/// A random scene with features that a `.glb` file can express.
pub(super) fn scene(numbers: &mut Numbers, kind: Kind) -> SceneParts {
    let mut parts = SceneParts::default();
    let walls = diffuse("walls", colour(numbers, 0.2, 0.8));
    let sides = room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    // The front is always open, and sometimes other sides.
    let kept = 2 + numbers.below(4);
    let [left, right, floor, ceiling, back, _] = sides;
    let sides = [floor, back, left, right, ceiling].into_iter().take(kept);
    parts.add(walls, sides);
    for i in 0..1 + numbers.below(4) {
        let material = material(numbers, kind);
        // Mostly in cells of their own, else anywhere.
        let at = if numbers.next() < 0.8 {
            let (column, row) = (i % 2, i / 2);
            Vec3::new(-0.5 + column as f32, 0.5, -0.5 + row as f32)
        } else {
            Vec3::new(
                numbers.next() - 0.5,
                0.3 + numbers.next(),
                numbers.next() - 0.5,
            )
        };
        let mesh = shape(numbers, at);
        parts.add(material, [mesh]);
    }
    let punctual = match kind {
        Kind::Any => numbers.next() < 0.5,
        Kind::Found { punctual } => punctual,
    };
    if punctual {
        for _ in 0..1 + numbers.below(2) {
            parts.lights.push(light(numbers));
        }
    }
    if !punctual || kind == Kind::Any && numbers.next() < 0.3 {
        let edge = 0.5 + 0.8 * numbers.next();
        let corner = Vec3::new(-0.5 * edge, 1.95, -0.5 * edge);
        let panel = quad(corner, Vec3::X * edge, Vec3::Z * edge);
        parts.add(emitter("lamp", colour(numbers, 1.0, 6.0)), [panel]);
    }
    let eye = [
        numbers.next() - 0.5,
        0.6 + 0.8 * numbers.next(),
        3.0 + numbers.next(),
    ];
    parts.add_camera(eye, [0.0, 0.8, 0.0], 35.0 + 20.0 * numbers.next());
    parts
}

/// Adds features that this program does not write to `.glb` files: a sky, a lens, thin films and media.
pub(super) fn finish(parts: &mut SceneParts, numbers: &mut Numbers, kind: Kind) {
    let sky = match kind {
        Kind::Any => numbers.next() < 0.4,
        Kind::Found { punctual } => !punctual && numbers.next() < 0.4,
    };
    if sky {
        parts.environment = Some(Environment::constant(colour(numbers, 0.1, 1.0)));
    }
    if numbers.next() < 0.3 {
        parts.cameras[0].lens = Some(Lens {
            radius: 0.2 * numbers.next() + 1e-3,
            focus: 2.0 + 2.0 * numbers.next(),
        });
    }
    if kind != Kind::Any {
        return;
    }
    if numbers.next() < 0.1 {
        parts.medium = Some(medium(numbers));
    }
    for material in &mut parts.materials {
        match numbers.below(12) {
            0 if material.solid => material.medium = Some(Box::new(medium(numbers))),
            1 => {
                let finish = material.finish.get_or_insert_default();
                finish.film = Some(FilmCover {
                    weight: numbers.next(),
                    ior: 1.0 + numbers.next(),
                    thickness: [100.0, 100.0 + 500.0 * numbers.next()],
                    ..FilmCover::default()
                });
            }
            _ => {}
        }
    }
}

fn medium(numbers: &mut Numbers) -> Medium {
    Medium {
        absorption: colour(numbers, 0.0, 0.5),
        scattering: colour(numbers, 0.1, 1.5),
        mean_cosine: 1.6 * numbers.next() - 0.8,
    }
}

fn colour(numbers: &mut Numbers, low: f32, high: f32) -> Rgb {
    Rgb::from_array(std::array::from_fn(|_| low + (high - low) * numbers.next()))
}

fn shape(numbers: &mut Numbers, at: Vec3) -> Mesh {
    let size = 0.15 + 0.2 * numbers.next();
    let turn: [f32; 3] = std::array::from_fn(|_| TAU * numbers.next());
    let mesh = match numbers.below(7) {
        0 => cuboid(Vec3::splat(-0.7 * size), Vec3::splat(0.7 * size)),
        1 => torus(0.75 * size, 0.25 * size, 24, 12),
        2 => cylinder(0.6 * size, size, 24).moved(Vec3::NEG_Y * 0.5 * size),
        3 => ring(0.8 * size, 0.1 * size, 0.6 * size, 24),
        4 => disc(size, 24),
        5 => quad(
            Vec3::new(-size, -size, 0.0),
            Vec3::X * 2.0 * size,
            Vec3::Y * 2.0 * size,
        ),
        _ => return sphere(at, size, 3 + numbers.below(2) as u32),
    };
    mesh.placed(turn, at)
}

fn material(numbers: &mut Numbers, kind: Kind) -> Material {
    let alpha = match kind {
        Kind::Found { punctual: true } => 0.2 + 0.8 * numbers.next(),
        Kind::Found { punctual: false } if numbers.next() < 0.3 => 0.0,
        Kind::Found { punctual: false } => 0.1 + 0.9 * numbers.next(),
        Kind::Any => [0.0, 1e-3, numbers.next() * numbers.next(), 1.0][numbers.below(4)],
    };
    let colour = colour(numbers, 0.05, 0.95);
    let mut material = match numbers.below(10) {
        0 => diffuse("diffuse", colour),
        1 => coated("coated", colour, alpha),
        2 => metal("metal", colour, alpha),
        3 => glass("glass", 1.05 + numbers.next(), alpha),
        4 => tinted_glass("tinted", 1.5, alpha, colour),
        5 => Material {
            solid: false,
            ..glass("pane", 1.5, alpha)
        },
        6 => Material {
            transmission: numbers.next(),
            ..coated("partly transmissive", colour, alpha)
        },
        7 => clearcoated(coated("lacquer", colour, 0.5), alpha),
        8 => brushed(
            metal("brushed", colour, alpha.max(0.05)),
            numbers.next(),
            numbers.next(),
        ),
        _ => Material {
            metallic: numbers.next(),
            ..coated("blend", colour, alpha)
        },
    };
    if kind == Kind::Any {
        match numbers.below(12) {
            0 => {
                material.opacity = numbers.next();
                material.alpha_mode = AlphaMode::Blend;
            }
            1 => material.priority = numbers.below(3) as f32 - 1.0,
            2 if material.solid => material.dispersion = numbers.next(),
            3 => {
                material.emission = Rgb::splat(numbers.next());
                material.double_sided = numbers.next() < 0.5;
            }
            _ => {}
        }
    }
    material
}

fn light(numbers: &mut Numbers) -> PunctualLight {
    let position = Vec3::new(
        numbers.next() - 0.5,
        1.5 + 0.4 * numbers.next(),
        numbers.next() - 0.5,
    );
    let down = Vec3::new(numbers.next() - 0.5, -1.0, numbers.next() - 0.5).normalize();
    let intensity = colour(numbers, 0.5, 2.0);
    match numbers.below(3) {
        0 => PunctualLight::Point {
            position,
            intensity,
            range: f32::INFINITY,
        },
        1 => PunctualLight::Spot {
            position,
            direction: down,
            intensity,
            range: f32::INFINITY,
            cos_inner: 0.9,
            cos_outer: 0.6,
            falloff: Default::default(),
        },
        _ => PunctualLight::Directional {
            direction: Vec3::new(down.x, down.y, -0.5).normalize(),
            irradiance: intensity,
        },
    }
}
