//! Triangle meshes, and attributes between their corners.

use crate::math::{Vec2, Vec3};
use glam::Vec4;
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
    /// Tangents with handedness in `w`, or empty (then derived where a normal map needs them).
    pub tangents: Vec<Vec4>,
    /// Corners of each triangle, counter-clockwise seen from the front.
    pub indices: Vec<[u32; 3]>,
    /// Index into `SceneParts::materials`.
    pub material: u32,
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
