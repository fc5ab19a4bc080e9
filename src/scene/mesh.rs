//! Triangle meshes, and the interpolation of their attributes.

use super::normals::along_u;
use crate::math::{DVec3, Vec2, Vec3};
use glam::{DAffine3, DMat3, Vec4};
use std::ops::{Add, Mul};

/// A triangle mesh in world space. Attributes are per vertex; an empty list means "none".
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Positions.
    pub positions: Vec<Vec3>,
    /// Unit normals, or empty for flat shading.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, or empty (then all zero).
    pub uvs: Vec<Vec2>,
    /// A second pair of texture coordinates, or empty (then all zero).
    pub second_uvs: Vec<Vec2>,
    /// Linear colours and opacities that multiply the material's, or empty (then all one).
    pub colors: Vec<Vec4>,
    /// Tangents with handedness in `w`, or empty (then derived where a normal map needs them).
    pub tangents: Vec<Vec4>,
    /// Corners of each triangle, counter-clockwise seen from the front.
    pub indices: Vec<[u32; 3]>,
    /// Index into `SceneParts::materials`.
    pub material: u32,
    /// Place in its file, for messages; may be empty.
    pub name: String,
}

impl Mesh {
    /// Sets tangents along u for a mesh with normals and texture coordinates: means over the faces at each vertex,
    /// weighted by area. Other meshes stay as they are.
    pub fn derive_tangents(&mut self) {
        if self.uvs.is_empty() || self.normals.is_empty() {
            return;
        }
        let mut sums = vec![Vec4::ZERO; self.positions.len()];
        for corners in &self.indices {
            let usable = attribute(&self.positions, corners).zip(attribute(&self.uvs, corners));
            let Some(([a, b, c], uvs)) = usable else {
                continue;
            };
            let edges = [b - a, c - a];
            let across = edges[0].cross(edges[1]);
            if let Some((along, hand)) = along_u(uvs, edges, across) {
                let part = along.normalize_or_zero().extend(hand) * across.length();
                corners.iter().for_each(|&i| sums[i as usize] += part);
            }
        }
        let unit = |t: Vec4| {
            let along = t.truncate().normalize_or_zero();
            along.extend(1f32.copysign(t.w))
        };
        self.tangents = sums.into_iter().map(unit).collect();
    }

    /// The mesh at a pose. The front stays the front under a mirroring pose.
    pub fn at(&self, pose: &DAffine3) -> Self {
        let mirrors = pose.matrix3.determinant() < 0.0;
        let sign = if mirrors { -1.0 } else { 1.0 };
        let normals = cofactors(&pose.matrix3) * sign;
        let point = |p: &Vec3| pose.transform_point3(p.as_dvec3()).as_vec3();
        let indices = |&[a, b, c]: &[u32; 3]| if mirrors { [a, c, b] } else { [a, b, c] };
        Self {
            positions: self.positions.iter().map(point).collect(),
            normals: (self.normals.iter())
                .map(|n| unit(normals * n.as_dvec3()))
                .collect(),
            tangents: (self.tangents.iter())
                .map(|t| {
                    let along = pose.transform_vector3(t.truncate().as_dvec3());
                    unit(along).extend(t.w)
                })
                .collect(),
            indices: self.indices.iter().map(indices).collect(),
            ..self.clone()
        }
    }
}

/// A mesh that is stored once and shown at several poses. Its material must not emit: light sampling covers only the
/// triangles of [`SceneParts::meshes`](super::SceneParts::meshes).
#[derive(Clone, Debug, Default)]
pub struct SharedMesh {
    /// The mesh in its own space.
    pub mesh: Mesh,
    /// Transforms from mesh space to the world, one per instance. The front stays the front under a mirroring one.
    pub poses: Vec<DAffine3>,
}

impl SharedMesh {
    /// Condition number of a pose, an upper bound; `None` for a pose that no instance may have: it is singular,
    /// flattens or shears by more than a factor of 1000, or scales by more than a million either way.
    pub fn condition(pose: &DAffine3) -> Option<f64> {
        const SCALE: f64 = 1e6;
        const SKEW: f64 = 1e3;
        let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let (there, back) = (norm(&pose.matrix3), norm(&pose.matrix3.inverse()));
        let condition = there * back;
        let good = pose.is_finite() && there <= SCALE && back <= SCALE && condition <= 3.0 * SKEW;
        good.then_some(condition)
    }
}

/// The values of an attribute at three corners; `None` if it is absent or too short.
#[inline]
pub(super) fn attribute<T: Copy>(values: &[T], indices: &[u32; 3]) -> Option<[T; 3]> {
    let at = |k: usize| values.get(indices[k] as usize).copied();
    Some([at(0)?, at(1)?, at(2)?])
}

/// Interpolates between corners.
#[inline]
pub(super) fn mix<T: Copy + Mul<f32, Output = T> + Add<Output = T>>(
    weights: &[f32; 3],
    at: [T; 3],
) -> T {
    at[0] * weights[0] + at[1] * weights[1] + at[2] * weights[2]
}

/// The cofactor matrix, which transforms normals: the inverse transpose up to a factor, but defined for singular
/// matrices too.
pub(super) fn cofactors(m: &DMat3) -> DMat3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}

/// The unit vector, or zero for a vector without direction. Unit vectors keep their bits.
pub(super) fn unit(v: DVec3) -> Vec3 {
    if (v.length_squared() - 1.0).abs() < 1e-6 {
        v.as_vec3()
    } else {
        v.normalize_or_zero().as_vec3()
    }
}
