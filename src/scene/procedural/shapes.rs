//! Shapes as meshes with material 0. The front of closed shapes is the outside.
//!
//! Trigonometry is done in double precision and rounded once, so that files do not depend on a platform's `sinf`.

use crate::math::Vec3;
use crate::scene::Mesh;
use glam::{Affine3A, DVec3, EulerRot, Quat};
use std::collections::HashMap;

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

impl Mesh {
    /// The mesh turned by the angles (radians) about y, x and z, then moved by `to`.
    pub fn placed(self, turn: [f32; 3], to: Vec3) -> Self {
        let turn = Quat::from_euler(EulerRot::YXZ, turn[0], turn[1], turn[2]);
        self.mapped(Affine3A::from_rotation_translation(turn, to))
    }

    /// The mesh moved by `to`.
    pub fn moved(self, to: Vec3) -> Self {
        self.mapped(Affine3A::from_translation(to))
    }

    fn mapped(mut self, map: Affine3A) -> Self {
        let normals = map.matrix3.inverse().transpose();
        for p in &mut self.positions {
            *p = map.transform_point3(*p);
        }
        for n in &mut self.normals {
            *n = (normals * *n).normalize();
        }
        for t in &mut self.tangents {
            let along = map.transform_vector3(t.truncate()).normalize();
            *t = along.extend(t.w);
        }
        self
    }

    /// The mesh turned inside out, as the wall of a cavity.
    pub fn inverted(mut self) -> Self {
        for face in &mut self.indices {
            face.swap(1, 2);
        }
        for n in &mut self.normals {
            *n = -*n;
        }
        self
    }

    /// Several meshes as one, with their positions, normals and faces only; all must be smooth or all flat.
    pub fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Self {
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
