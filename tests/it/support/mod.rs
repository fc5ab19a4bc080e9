//! Tools of several tests.

pub(crate) mod draws;
pub(crate) mod gltf;
pub(crate) mod render;
pub(crate) mod scenes;

use super::lab::verify::{Finding, chi_square};
use std::path::Path;

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.ancestors().nth(2).expect("crates/cli")
}

/// A folder for many small files, in memory if the system has /dev/shm.
pub(crate) fn quick_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
    folder.expect("a folder")
}

/// Fails if one of the bounds does not hold.
pub(crate) fn holds(findings: impl IntoIterator<Item = Finding>) {
    let mut count = 0;
    for finding in findings {
        eprintln!("{finding:?}");
        assert!(finding.holds(), "{finding:?}");
        count += 1;
    }
    assert!(count > 0);
}

/// Fails if one of the named p-values is below 0.01 over their number (Bonferroni's correction).
pub(crate) fn assert_likely(p_values: &[(f64, String)]) {
    holds(vec![chi_square::finding("chi-square", p_values)]);
}

/// The transfer function of sRGB, of a value in [0, 1].
pub(crate) fn srgb(x: f32) -> f32 {
    match x <= 0.003_130_8 {
        true => 12.92 * x,
        false => 1.055 * x.powf(1.0 / 2.4) - 0.055,
    }
}
