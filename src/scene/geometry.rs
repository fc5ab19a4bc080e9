//! Triangles in scene order, their attributes, and the tree over them.

use super::{Hit, SceneParts, Surface};
use crate::math::Ray;

/// All triangles of a scene.
pub struct Geometry {}

impl Geometry {
    /// Collects the triangles of all meshes and builds the tree.
    pub fn new(parts: &SceneParts, warnings: &mut Vec<String>) -> Self {
        let _ = (parts, warnings);
        todo!()
    }

    /// Closest hit; parts that opacity removes are skipped.
    #[inline]
    pub fn intersect(&self, parts: &SceneParts, ray: &Ray) -> Option<Hit> {
        let _ = (parts, ray);
        todo!()
    }

    /// Any hit before the ray's end.
    #[inline]
    pub fn occluded(&self, parts: &SceneParts, ray: &Ray) -> bool {
        let _ = (parts, ray);
        todo!()
    }

    /// Interpolates a hit.
    pub fn surface(&self, parts: &SceneParts, ray: &Ray, hit: &Hit) -> Surface {
        let _ = (parts, ray, hit);
        todo!()
    }
}
