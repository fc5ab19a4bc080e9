//! Shapes as meshes with exact normals. Curved shapes are fine enough that their outlines look round.

use glam::Quat;
use opsr::math::{Vec2, Vec3};
use opsr::scene::Mesh;
use std::f32::consts::{PI, TAU};

/// Segments of a full turn.
const SEGMENTS: u32 = 256;

/// A grid of points over (u, v) in [0, 1]². `point` gives position and normal; the front is where ∂/∂u × ∂/∂v points.
pub fn grid(columns: u32, rows: u32, point: impl Fn(Vec2) -> (Vec3, Vec3)) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=rows {
        for i in 0..=columns {
            let uv = Vec2::new(i as f32 / columns as f32, j as f32 / rows as f32);
            let (position, normal) = point(uv);
            mesh.positions.push(position);
            mesh.normals.push(normal);
            mesh.uvs.push(uv);
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let a = j * (columns + 1) + i;
            let (b, c) = (a + columns + 1, a + columns + 2);
            mesh.indices.extend([[a, a + 1, c], [a, c, b]]);
        }
    }
    mesh
}

/// The square [−1, 1]² of the plane z = 0, front at +z.
pub fn rectangle() -> Mesh {
    grid(1, 1, |uv| ((2.0 * uv - 1.0).extend(0.0), Vec3::Z))
}

/// Axes of the texture coordinates of the faces of [`cube`], as Mitsuba's cube has them: normal, u, v.
const FACES: [[Vec3; 3]; 6] = [
    [Vec3::X, Vec3::Y, Vec3::NEG_Z],
    [Vec3::NEG_X, Vec3::Y, Vec3::Z],
    [Vec3::Y, Vec3::NEG_X, Vec3::NEG_Z],
    [Vec3::NEG_Y, Vec3::Z, Vec3::X],
    [Vec3::Z, Vec3::Y, Vec3::X],
    [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X],
];

/// The cube [−1, 1]³, front outside.
pub fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    for [normal, u, v] in FACES {
        let face = grid(1, 1, |uv| {
            let p = 2.0 * uv - 1.0;
            (normal + p.x * u + p.y * v, normal)
        });
        append(&mut mesh, &face);
    }
    super::face_normals_outwards(&mut mesh);
    mesh
}

/// Adds a mesh of the same attributes to another.
pub fn append(mesh: &mut Mesh, other: &Mesh) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(&other.positions);
    mesh.normals.extend(&other.normals);
    mesh.uvs.extend(&other.uvs);
    let moved = other.indices.iter().map(|face| face.map(|i| i + first));
    mesh.indices.extend(moved);
}

/// A sphere, front outside, poles at ±z; u by the azimuth from +x, v from the pole at +z. It is swollen so that its
/// triangles deviate equally to the outside and the inside.
pub fn sphere(centre: Vec3, radius: f32) -> Mesh {
    part_of_sphere(centre, radius, [0.0, PI], TAU)
}

/// The part of a sphere between two angles from +z and from azimuth 0 to `phi`, in radians; (u, v) as in [`sphere`].
pub fn part_of_sphere(centre: Vec3, radius: f32, [from, to]: [f32; 2], phi: f32) -> Mesh {
    let columns = ((SEGMENTS as f32 * phi / TAU).ceil() as u32).max(3);
    let rows = ((SEGMENTS as f32 * (to - from) / TAU).ceil() as u32).max(2);
    // Chords lie inside the sphere: the larger radius halves the largest deviation.
    let swell = 1.0 / (1.0 - (PI / SEGMENTS as f32).powi(2) / 3.0);
    let mut mesh = grid(columns, rows, |uv| {
        let (theta, phi) = (from + uv.y * (to - from), uv.x * phi);
        // At a pole all points of a row coincide exactly.
        let pole = !(1e-6..=PI - 1e-6).contains(&theta);
        let sin = if pole { 0.0 } else { theta.sin() };
        let n = Vec3::new(sin * phi.cos(), sin * phi.sin(), theta.cos());
        (centre + radius * swell * n, n)
    });
    mesh.indices.iter_mut().for_each(|face| face.swap(1, 2));
    without_points(mesh)
}

/// Removes triangles with coinciding corners, such as those at a pole.
fn without_points(mut mesh: Mesh) -> Mesh {
    let positions = &mesh.positions;
    mesh.indices.retain(|face| {
        let [a, b, c] = face.map(|i| positions[i as usize]);
        a != b && b != c && c != a
    });
    mesh
}

/// A disk, or ring, in the plane z = `height`, front at +z; u by the radius over the largest, v by the azimuth.
pub fn disk(height: f32, radius: f32, inner: f32, phi: f32) -> Mesh {
    // The polygon has the area of the circle.
    let swell = (TAU / SEGMENTS as f32 / (TAU / SEGMENTS as f32).sin()).sqrt();
    let rows = ((SEGMENTS as f32 * phi / TAU).ceil() as u32).max(3);
    let mut mesh = grid(1, rows, |uv| {
        let r = (inner + (radius - inner) * uv.x) * swell;
        let (sin, cos) = (uv.y * phi).sin_cos();
        (Vec3::new(r * cos, r * sin, height), Vec3::Z)
    });
    let least = inner / radius;
    mesh.uvs
        .iter_mut()
        .for_each(|uv| uv.x = least + (1.0 - least) * uv.x);
    without_points(mesh)
}

/// The mantle of a cylinder about z, front outside.
pub fn cylinder(radius: f32, [low, high]: [f32; 2], phi: f32) -> Mesh {
    let swell = (TAU / SEGMENTS as f32 / (TAU / SEGMENTS as f32).sin()).sqrt();
    let columns = ((SEGMENTS as f32 * phi / TAU).ceil() as u32).max(3);
    grid(columns, 1, |uv| {
        let (sin, cos) = (uv.x * phi).sin_cos();
        let n = Vec3::new(cos, sin, 0.0);
        (
            radius * swell * n + (low + uv.y * (high - low)) * Vec3::Z,
            n,
        )
    })
}

/// Rows of a surface of revolution.
const ROWS: u32 = 64;

/// The surface of revolution of a curve over [0, 1] about z; u by the azimuth, v along the curve.
pub fn revolved(curve: impl Fn(f32) -> Vec3, phi: f32) -> Mesh {
    let columns = ((SEGMENTS as f32 * phi / TAU).ceil() as u32).max(3);
    without_points(grid(columns, ROWS, |uv| {
        let turn = Quat::from_rotation_z(uv.x * phi);
        // On the axis the normal is that of a point nearby: there the curve itself gives none.
        let v = uv.y.clamp(1e-3, 1.0 - 1e-3);
        let along = curve(v + 1e-3) - curve(v - 1e-3);
        let normal = Vec3::Z.cross(curve(v)).cross(along).normalize_or_zero();
        (turn * curve(uv.y), turn * normal)
    }))
}

/// Sides of a tube.
const SIDES: u32 = 6;

/// Bytes that a point of a tube needs.
pub(crate) const TUBE_BYTES: u64 = (SIDES as u64 + 1) * 32 + 2 * SIDES as u64 * 12;

/// An open tube around points, each with its radius; u along the tube, v around it.
pub fn tube(points: &[(Vec3, f32)]) -> Mesh {
    let direction = |i: usize| {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(points.len() - 1));
        (points[after].0 - points[before].0).try_normalize()
    };
    let mut across = Vec3::ZERO;
    let frames: Vec<(Vec3, Vec3)> = (0..points.len())
        .map(|i| {
            let along = direction(i).unwrap_or(Vec3::Z);
            // The frame turns as little as the curve allows.
            across = (across - along * along.dot(across))
                .try_normalize()
                .unwrap_or(along.any_orthonormal_vector());
            (across, along.cross(across))
        })
        .collect();
    let rows = points.len() as u32 - 1;
    let mut mesh = grid(SIDES, rows, |uv| {
        let i = (uv.y * rows as f32).round() as usize;
        let ((s, t), (sin, cos)) = (frames[i], (uv.x * TAU).sin_cos());
        let normal = s * cos + t * sin;
        (points[i].0 + points[i].1 * normal, normal)
    });
    mesh.uvs
        .iter_mut()
        .for_each(|uv| *uv = Vec2::new(uv.y, uv.x));
    mesh
}

/// A bilinear patch with corners and their texture coordinates in the order (u, v) = (0, 0), (1, 0), (0, 1) and (1, 1).
pub fn patch(corners: [Vec3; 4], uvs: [Vec2; 4], normals: Option<[Vec3; 4]>) -> Mesh {
    let [a, b, c, d] = corners;
    let flat = (b - a).cross(c - a).normalize_or_zero();
    let size = (d - a).length().max((c - b).length());
    let planar = (d - a).dot(flat).abs() <= 1e-5 * size;
    let n = if planar && normals.is_none() { 1 } else { 16 };
    let mut mesh = grid(n, n, |uv| {
        let (low, high) = (a.lerp(b, uv.x), c.lerp(d, uv.x));
        let along = (b - a).lerp(d - c, uv.y);
        let normal = match normals {
            Some([a, b, c, d]) => a.lerp(b, uv.x).lerp(c.lerp(d, uv.x), uv.y),
            None => along.cross(high - low),
        };
        let normal = normal.normalize_or_zero();
        (low.lerp(high, uv.y), normal)
    });
    let at = |uv: &Vec2| (uvs[0].lerp(uvs[1], uv.x)).lerp(uvs[2].lerp(uvs[3], uv.x), uv.y);
    mesh.uvs = mesh.uvs.iter().map(at).collect();
    mesh
}

#[cfg(test)]
mod tests;
