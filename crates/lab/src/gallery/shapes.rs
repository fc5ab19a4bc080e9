//! Shapes as meshes with material 0. The front of closed shapes is the outside.
//!
//! Trigonometry is done in double precision and rounded once, so that files do not depend on a platform's `sinf`.

use glam::{Affine3A, DVec3, EulerRot, Quat};
use opsr::math::{Vec2, Vec3};
use opsr::scene::Mesh;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Neighbouring faces of a profile share a smooth normal below this angle (cosine of 35°).
const CREASE: f32 = 0.82;

/// A parallelogram `corner`, `corner + u`, … whose front is where `u × v` points.
pub fn quad(corner: Vec3, u: Vec3, v: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A flat-shaded box between two corners.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let positions = (0..8)
        .map(|i| {
            let pick = |bit: u32, lo: f32, hi: f32| if i >> bit & 1 == 1 { hi } else { lo };
            Vec3::new(
                pick(0, min.x, max.x),
                pick(1, min.y, max.y),
                pick(2, min.z, max.z),
            )
        })
        .collect();
    let sides = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    Mesh {
        positions,
        indices: sides
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        ..Mesh::default()
    }
}

/// A sphere with smooth normals: an icosahedron whose faces are divided into four `divisions` times (20·4^divisions
/// faces).
pub fn sphere(centre: Vec3, radius: f32, divisions: u32) -> Mesh {
    let (directions, indices) = icosphere(divisions);
    Mesh {
        positions: directions
            .iter()
            .map(|d| centre + (f64::from(radius) * *d).as_vec3())
            .collect(),
        normals: directions.iter().map(|d| d.as_vec3()).collect(),
        indices,
        ..Mesh::default()
    }
}

/// A sphere of radius 1 whose surface is moved to `radius(direction)`, with smooth normals.
pub fn blob(divisions: u32, radius: impl Fn(DVec3) -> f64) -> Mesh {
    let (directions, indices) = icosphere(divisions);
    let mut mesh = Mesh {
        positions: directions
            .iter()
            .map(|&d| (radius(d) * d).as_vec3())
            .collect(),
        indices,
        ..Mesh::default()
    };
    smooth(&mut mesh);
    mesh
}

fn icosphere(divisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let t = 0.5 * (1.0 + 5.0f64.sqrt());
    let corners = [
        (-1.0, t, 0.0),
        (1.0, t, 0.0),
        (-1.0, -t, 0.0),
        (1.0, -t, 0.0),
        (0.0, -1.0, t),
        (0.0, 1.0, t),
        (0.0, -1.0, -t),
        (0.0, 1.0, -t),
        (t, 0.0, -1.0),
        (t, 0.0, 1.0),
        (-t, 0.0, -1.0),
        (-t, 0.0, 1.0),
    ];
    #[rustfmt::skip]
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
        [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
        [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    let mut points: Vec<DVec3> = corners
        .iter()
        .map(|&(x, y, z)| DVec3::new(x, y, z).normalize())
        .collect();
    for _ in 0..divisions {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(4 * faces.len());
        for &[a, b, c] in &faces {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = finer;
    }
    (points, faces)
}

/// Sets the normals of a mesh to area-weighted means of the normals of its faces.
pub fn smooth(mesh: &mut Mesh) {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for &[a, b, c] in &mesh.indices {
        let p = |i: u32| mesh.positions[i as usize].as_dvec3();
        let n = (p(b) - p(a)).cross(p(c) - p(a));
        for i in [a, b, c] {
            sums[i as usize] += n;
        }
    }
    mesh.normals = sums
        .iter()
        .map(|n| n.normalize_or(DVec3::Y).as_vec3())
        .collect();
}

/// The six walls of a room seen from inside: x low, x high, floor, ceiling, z low, z high.
pub fn room(min: Vec3, max: Vec3) -> [Mesh; 6] {
    let d = max - min;
    let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
    [
        quad(min, y, z),
        quad(max, -z, -y),
        quad(min, z, x),
        quad(max, -x, -z),
        quad(min, x, y),
        quad(max, -y, -x),
    ]
}

/// Poses and unions of meshes.
pub trait Placing: Sized {
    /// The mesh turned by the angles (radians) about y, x and z, then moved by `to`.
    fn placed(self, turn: [f32; 3], to: Vec3) -> Self;
    /// The mesh moved by `to`.
    fn moved(self, to: Vec3) -> Self;
    /// The mesh turned inside out, as the wall of a cavity.
    fn inverted(self) -> Self;
    /// Several meshes as one, with their positions, normals and faces only; all must be smooth or all flat.
    fn joined(meshes: impl IntoIterator<Item = Self>) -> Self;
}

impl Placing for Mesh {
    fn placed(self, turn: [f32; 3], to: Vec3) -> Self {
        let turn = Quat::from_euler(EulerRot::YXZ, turn[0], turn[1], turn[2]);
        mapped(self, Affine3A::from_rotation_translation(turn, to))
    }

    fn moved(self, to: Vec3) -> Self {
        mapped(self, Affine3A::from_translation(to))
    }

    fn inverted(mut self) -> Self {
        for face in &mut self.indices {
            face.swap(1, 2);
        }
        for n in &mut self.normals {
            *n = -*n;
        }
        self
    }

    fn joined(meshes: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Mesh::default();
        for mesh in meshes {
            let start = all.positions.len() as u32;
            all.positions.extend(mesh.positions);
            all.normals.extend(mesh.normals);
            all.indices
                .extend(mesh.indices.iter().map(|f| f.map(|i| i + start)));
        }
        debug_assert!(all.normals.is_empty() || all.normals.len() == all.positions.len());
        all
    }
}

fn mapped(mut mesh: Mesh, map: Affine3A) -> Mesh {
    let normals = map.matrix3.inverse().transpose();
    for p in &mut mesh.positions {
        *p = map.transform_point3(*p);
    }
    for n in &mut mesh.normals {
        *n = (normals * *n).normalize();
    }
    for t in &mut mesh.tangents {
        let along = map.transform_vector3(t.truncate()).normalize();
        *t = along.extend(t.w);
    }
    mesh
}

/// A prism over a convex polygon of the (x, y) plane, counter-clockwise, from z = -depth/2 to depth/2; flat shading.
pub fn prism(polygon: &[Vec2], depth: f32) -> Mesh {
    let n = polygon.len() as u32;
    let ring = |z: f32| polygon.iter().map(move |p| p.extend(z));
    let mut indices = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        indices.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    for i in 1..n - 1 {
        indices.extend([[0, i + 1, i], [n, n + i, n + i + 1]]);
    }
    Mesh {
        positions: ring(-0.5 * depth).chain(ring(0.5 * depth)).collect(),
        indices,
        ..Mesh::default()
    }
}

/// A torus around the y axis with smooth normals.
pub fn torus(major: f32, minor: f32, segments: u32, sides: u32) -> Mesh {
    let profile: Vec<Vec2> = (0..sides)
        .map(|i| {
            let (s, c) = (TAU * f64::from(i) / f64::from(sides)).sin_cos();
            Vec2::new(major + minor * c as f32, minor * s as f32)
        })
        .collect();
    revolve(&profile, true, segments)
}

/// A flat-topped ring on the plane y = 0: a wall of the given thickness around the y axis. Polished, it casts the cusped
/// caustic of a napkin ring.
pub fn ring(radius: f32, thickness: f32, height: f32, segments: u32) -> Mesh {
    let (inner, outer) = (radius - 0.5 * thickness, radius + 0.5 * thickness);
    let profile = [
        Vec2::new(inner, 0.0),
        Vec2::new(outer, 0.0),
        Vec2::new(outer, height),
        Vec2::new(inner, height),
    ];
    revolve(&profile, true, segments)
}

/// A closed cylinder on the plane y = 0.
pub fn cylinder(radius: f32, height: f32, segments: u32) -> Mesh {
    let profile = [
        Vec2::ZERO,
        Vec2::new(radius, 0.0),
        Vec2::new(radius, height),
        Vec2::new(0.0, height),
    ];
    revolve(&profile, false, segments)
}

/// A flat disc on the plane y = 0 that faces up, with a hole of a tenth of its radius. Its tangents run around the axis, as
/// the grooves of a turned plate do.
pub fn disc(radius: f32, segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let rings: Vec<_> = (1..=10)
        .rev()
        .map(|k| {
            let edge = Vec2::new(0.1 * radius * k as f32, 0.0);
            add_ring(&mut mesh, edge, Vec2::Y, segments)
        })
        .collect();
    rings
        .windows(2)
        .for_each(|pair| stitch(&mut mesh, &pair[0], &pair[1]));
    let around = |p: &Vec3| Vec3::Y.cross(*p).normalize().extend(1.0);
    mesh.tangents = mesh.positions.iter().map(around).collect();
    mesh
}

/// Turns a profile of (radius, height) around the y axis. The solid lies to the left of the profile: it runs up the
/// outside, and down the inside of a vessel. An open profile should begin and end on the axis; `closed` joins its end
/// to its beginning. Corners sharper than 35° stay sharp.
pub fn revolve(profile: &[Vec2], closed: bool, segments: u32) -> Mesh {
    let points = profile.len();
    let pieces = if closed { points } else { points - 1 };
    let normal_of = |i: usize| {
        let d = profile[(i + 1) % points] - profile[i];
        Vec2::new(d.y, -d.x).normalize_or_zero()
    };
    let mut mesh = Mesh::default();
    // First and last ring of each segment of the profile.
    let mut ends = Vec::with_capacity(pieces);
    let mut before: Option<(Vec<u32>, Vec2)> = None;
    let mut first = None;
    for i in 0..pieces {
        let n = normal_of(i);
        let shared = |other: Vec2| other.dot(n) > CREASE;
        let begin = match &before {
            Some((ring, other)) if shared(*other) => ring.clone(),
            None if closed && shared(normal_of(points - 1)) => {
                let normal = (n + normal_of(points - 1)).normalize();
                add_ring(&mut mesh, profile[0], normal, segments)
            }
            _ => add_ring(&mut mesh, profile[i], n, segments),
        };
        first.get_or_insert_with(|| begin.clone());
        let last = i + 1 == pieces;
        let end = match (&first, last && closed) {
            (Some(ring), true) if normal_of(0).dot(n) > CREASE => ring.clone(),
            _ => {
                let after = if last && !closed {
                    n
                } else {
                    normal_of((i + 1) % points)
                };
                let normal = if shared(after) {
                    (n + after).normalize()
                } else {
                    n
                };
                add_ring(&mut mesh, profile[(i + 1) % points], normal, segments)
            }
        };
        before = Some((end.clone(), n));
        ends.push((begin, end));
    }
    for (a, b) in &ends {
        stitch(&mut mesh, a, b);
    }
    mesh
}

/// A ring of vertices around the y axis (a single one on the axis) with the profile's normal; returns their indices.
fn add_ring(mesh: &mut Mesh, point: Vec2, normal: Vec2, segments: u32) -> Vec<u32> {
    let start = mesh.positions.len() as u32;
    if point.x == 0.0 {
        mesh.positions.push(Vec3::new(0.0, point.y, 0.0));
        mesh.normals.push(Vec3::Y * normal.y.signum());
        return vec![start];
    }
    for i in 0..segments {
        let (s, c) = (TAU * f64::from(i) / f64::from(segments)).sin_cos();
        let (s, c) = (s as f32, c as f32);
        mesh.positions
            .push(Vec3::new(point.x * c, point.y, point.x * s));
        mesh.normals
            .push(Vec3::new(normal.x * c, normal.y, normal.x * s));
    }
    (start..start + segments).collect()
}

fn stitch(mesh: &mut Mesh, a: &[u32], b: &[u32]) {
    let n = a.len().max(b.len());
    for i in 0..n {
        let j = (i + 1) % n;
        let (a0, a1) = (a[i % a.len()], a[j % a.len()]);
        let (b0, b1) = (b[i % b.len()], b[j % b.len()]);
        if b.len() > 1 {
            mesh.indices.push([a0, b0, b1]);
        }
        if a.len() > 1 {
            mesh.indices.push([a0, b1, a1]);
        }
    }
}

/// The surface y = `height(x, z)` over a rectangle, front upward, with smooth normals.
pub fn height_field(
    min: Vec2,
    max: Vec2,
    cells: [u32; 2],
    height: impl Fn(f64, f64) -> f64,
) -> Mesh {
    let mut mesh = Mesh::default();
    let (min, size) = (min.as_dvec2(), (max - min).as_dvec2());
    for j in 0..=cells[1] {
        for i in 0..=cells[0] {
            let x = min.x + size.x * f64::from(i) / f64::from(cells[0]);
            let z = min.y + size.y * f64::from(j) / f64::from(cells[1]);
            let h = 1e-4;
            let dx = (height(x + h, z) - height(x - h, z)) / (2.0 * h);
            let dz = (height(x, z + h) - height(x, z - h)) / (2.0 * h);
            mesh.positions
                .push(DVec3::new(x, height(x, z), z).as_vec3());
            mesh.normals
                .push(DVec3::new(-dx, 1.0, -dz).normalize().as_vec3());
        }
    }
    let row = cells[0] + 1;
    for j in 0..cells[1] {
        for i in 0..cells[0] {
            let a = j * row + i;
            let (b, c, d) = (a + 1, a + row, a + row + 1);
            mesh.indices.extend([[a, c, d], [a, d, b]]);
        }
    }
    mesh
}

/// A smooth curve through the points, with `steps` segments between neighbours (uniform Catmull–Rom).
pub fn curve(points: &[Vec2], steps: u32) -> Vec<Vec2> {
    let at = |i: isize| points[i.clamp(0, points.len() as isize - 1) as usize];
    let mut out = vec![points[0]];
    for i in 0..points.len() as isize - 1 {
        let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for k in 1..=steps {
            let t = k as f32 / steps as f32;
            let p = 2.0 * b
                + (c - a) * t
                + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
                + (3.0 * b - a - 3.0 * c + d) * t * t * t;
            out.push(if k == steps { c } else { 0.5 * p });
        }
    }
    out
}
