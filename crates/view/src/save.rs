//! Files of a render in progress, by the code that writes files of finished renders.

use opsr::render::{Fault, Outcome};

/// The bytes of the file with this name, which ends in `.png` or `.exr`.
pub(super) fn encoded(outcome: Outcome<'_>, name: &str) -> Result<Vec<u8>, Fault> {
    let failed = |e: std::io::Error| Fault::Output(format!("a temporary file: {e}"));
    let folder = tempfile::tempdir().map_err(failed)?;
    let file = folder.path().join(name);
    let denoiser = outcome.spec.denoiser()?;
    outcome.finish(denoiser.as_ref())?.save(&file)?;
    std::fs::read(&file).map_err(failed)
}
