//! Writes that leave either the old file or the new one, never half of one.

use super::{FileError, Problem};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a temporary file in the same folder, which takes its name only when all of it is on disk.
///
/// A run that is stopped, or a full disk, leaves the old file as it was.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), FileError> {
    replace(path, fill).map_err(|e| Problem::Write(e).at(path))
}

/// [`write()`] of bytes in memory.
pub fn write_bytes(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), FileError> {
    write(path, |out| out.write_all(bytes.as_ref()))
}

/// Makes a folder and those above it; one that exists is no error.
pub fn create_folder(path: &Path) -> Result<(), FileError> {
    std::fs::create_dir_all(path).map_err(|e| Problem::Write(e).at(path))
}

fn replace(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> io::Result<()> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; a result is an ordinary file, so the umask decides.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    {
        let mut out = BufWriter::new(file.as_file_mut());
        fill(&mut out)?;
        out.flush()?;
    }
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}
