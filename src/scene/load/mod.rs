//! glTF files (`.gltf`, `.glb`) to scene parts. The only user of the crate gltf, and the only place that knows
//! perceptual roughness.

mod error;

pub use error::LoadError;

use super::SceneParts;
use crate::bsdf::Distribution;
use std::path::Path;

/// What a file does not say.
#[derive(Clone, Copy, Debug)]
pub struct LoadOptions {
    /// Slope distribution of all glossy lobes.
    pub distribution: Distribution,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            distribution: Distribution::Beckmann,
        }
    }
}

/// A file's scene.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub parts: SceneParts,
    /// What the file asks for and does not get; one line each.
    pub warnings: Vec<String>,
    /// SHA-256 over the file and every external buffer and image it uses, in that order.
    pub digest: [u8; 32],
}

/// Reads a scene. Nothing in the file can make it panic or allocate much more than the file's own size.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let _ = options;
    Err(LoadError::Invalid {
        path: path.to_owned(),
        place: "file".to_owned(),
        what: "glTF files cannot be read yet".to_owned(),
    })
}
