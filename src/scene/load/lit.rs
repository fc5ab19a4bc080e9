//! Decides if a file contains light. Most models contain none, and viewers add it.

use crate::math::Rgb;
use crate::scene::{Material, Mesh, SceneParts};

/// Light that a file contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileLight {
    /// None; `KHR_materials_unlit` does not count.
    None,
    /// Surfaces that emit: lamps or decoration, depending on the light at other surfaces (`Scene::lighting`).
    Surfaces,
    /// Lights without area, or an environment.
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
