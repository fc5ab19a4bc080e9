//! Triangle meshes.

use crate::math::{Vec2, Vec3};
use glam::Vec4;

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
