//! The file of the scene.

use std::path::{Path, PathBuf};

/// The file of a scene.
#[derive(Debug)]
pub(super) struct SceneFile {
    pub(super) path: PathBuf,
    /// Its name in commands and messages.
    pub(super) name: String,
}

impl SceneFile {
    /// A file that the command line named.
    pub(super) fn named(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            name: path.display().to_string(),
        }
    }

    /// The name without folders and ending.
    pub(super) fn title(&self) -> String {
        let stem = self.path.file_stem();
        stem.map_or(String::new(), |stem| stem.to_string_lossy().into_owned())
    }
}
