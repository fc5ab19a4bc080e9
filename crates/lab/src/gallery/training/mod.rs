//! The scenes of `training_scenes/`, as code: `opsr scenes write` turns them into files. Their crops and exposures are in
//! the manifest.
//!
//! Together their paths visit nearly all classes whose last vertex can be roughened. They have sharp caustics of every
//! kind, because a blurred caustic tolerates any roughening. Their relative noise stays below about 0.3 in a pixel of
//! 1024 samples, because a noisy L1 loss prefers to lose energy.

mod boxes;
mod glass;
mod glossy;
mod rooms;
mod validation;
mod water;

use super::Builder;
use super::glb::SaveError;
use opsr::files;
use std::path::{Path, PathBuf};

/// The text of `training_scenes/manifest.toml`.
pub const MANIFEST: &str = include_str!("../../../../../training_scenes/manifest.toml");

/// Builders of the manifest's scenes, by name.
pub(super) const BUILDERS: [Builder; 12] = [
    ("cornell_caustics", boxes::cornell_caustics),
    ("cornell_glossy", boxes::cornell_glossy),
    ("glass_in_glass", glass::glass_in_glass),
    ("bulb_lamp", glass::bulb_lamp),
    ("rings", glossy::rings),
    ("glossy_corridor", glossy::corridor),
    ("basins", water::basins),
    ("many_roughnesses", rooms::many_roughnesses),
    ("frosted_panes", rooms::frosted_panes),
    ("swimming_pool", validation::swimming_pool),
    ("figurines", validation::figurines),
    ("disco", validation::disco),
];

/// Writes all scenes and their manifest into a folder, which is created if it does not exist; returns the files.
pub fn write(folder: &Path) -> Result<Vec<PathBuf>, SaveError> {
    let mut written = super::write(BUILDERS.map(|(name, _)| name), folder)?;
    let path = folder.join("manifest.toml");
    files::write_bytes(&path, MANIFEST)?;
    written.push(path);
    Ok(written)
}
