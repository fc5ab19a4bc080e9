//! Instruments that several tests share.

pub(crate) mod chi2;
pub(crate) mod gltf;
pub(crate) mod naive;
pub(crate) mod render;
pub(crate) mod slopes;

/// A folder for many small files, in memory where the system has a place for that.
pub(crate) fn quick_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
    folder.expect("a folder")
}
