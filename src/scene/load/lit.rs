//! Finds out if a file has a light of its own. Most models have none: viewers add one.

use crate::math::Rgb;
use crate::scene::{Material, Mesh, SceneParts};

/// Light that a file brings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileLight {
    /// None. Unlit materials are pictures, not lamps.
    None,
    /// Surfaces that emit: lamps or decoration. The light that they bring to the scene decides (`Scene::lighting`).
    Surfaces,
    /// Lamps that someone has put there, or surroundings.
    Lamps,
}

impl FileLight {
    /// Light of the parts of a model.
    pub fn of(parts: &SceneParts) -> Self {
        if !parts.lights.is_empty() || parts.environment.is_some() {
            return Self::Lamps;
        }
        let emits = |m: &Material| m.emission != Rgb::ZERO && !m.unlit;
        let shines = |mesh: &Mesh| (parts.materials.get(mesh.material as usize)).is_some_and(emits);
        match parts.all_meshes().any(shines) {
            true => Self::Surfaces,
            false => Self::None,
        }
    }
}
