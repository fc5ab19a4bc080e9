//! Files of a render on its way, by the code that writes those of a finished one.

use super::hub::Kept;
use crate::render::Fault;
use crate::render::files::Outputs;

/// The bytes of the file with this name, which ends in `.png` or `.exr`.
pub(super) fn encoded(kept: Kept, name: &str) -> Result<Vec<u8>, Fault> {
    let failed = |e: std::io::Error| Fault::Output(format!("a temporary file: {e}"));
    let folder = tempfile::tempdir().map_err(failed)?;
    let file = folder.path().join(name);
    let mut outputs = Outputs::new(std::slice::from_ref(&file), &kept.spec)?;
    if kept.in_studio {
        outputs.never_brighten();
    }
    let pose = Some(kept.world_to_camera);
    outputs.write(&kept.picture, kept.layers, pose, &kept.metadata)?;
    std::fs::read(&file).map_err(failed)
}
