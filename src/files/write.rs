//! Writes that leave either the old file or the new one, never half of one.

use super::{FileError, Problem};
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

/// Destination of a write, links followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// A regular file, or a name that is free: replaced as a whole.
    Whole(PathBuf),
    /// A device, a pipe, or an open stream of a process such as `/dev/stdout`: written into, never replaced.
    Stream,
}

impl Target {
    /// The destination that a path names; a link that leads nowhere names the file to be made there.
    pub fn of(path: &Path) -> io::Result<Self> {
        /// Number of links that Linux follows.
        const LINKS: usize = 40;
        let mut path = path.to_owned();
        for _ in 0..LINKS {
            let kind = match path.symlink_metadata() {
                Ok(metadata) => metadata.file_type(),
                Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Self::Whole(path)),
                Err(e) => return Err(e),
            };
            if !kind.is_symlink() {
                // Writing to a folder fails later, with the system's words.
                let whole = kind.is_file() || kind.is_dir();
                return Ok(if whole {
                    Self::Whole(path)
                } else {
                    Self::Stream
                });
            }
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            // Links to open streams have targets that are no paths.
            if folder.canonicalize().is_ok_and(|f| f.starts_with("/proc")) {
                return Ok(Self::Stream);
            }
            path = folder.join(path.read_link()?);
        }
        Err(io::Error::other("too many symbolic links"))
    }
}

/// Writes a temporary file in the same folder, which takes its name only when all of it is on disk.
///
/// A run that is stopped, or a full disk, leaves the old file as it was. Links stay, what they name is replaced. Devices
/// and pipes get the bytes when all of them are known.
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
    let path = match Target::of(path)? {
        Target::Whole(path) => path,
        Target::Stream => return append(path, fill),
    };
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; a result is an ordinary file, so the umask decides.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    filled(file.as_file_mut(), fill)?;
    file.as_file().sync_all()?;
    file.persist(&path).map_err(|e| e.error)?;
    Ok(())
}

/// Writes behind what a stream already got.
fn append(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut whole = tempfile::tempfile()?;
    filled(&mut whole, fill)?;
    whole.rewind()?;
    let mut stream = open_stream(path)?;
    io::copy(&mut whole, &mut stream)?;
    stream.flush()
}

/// Time that somebody has to read from a pipe.
const PATIENCE: Duration = Duration::from_secs(10);

/// Opens a stream. A pipe opens when somebody reads from it, which may be never.
fn open_stream(path: &Path) -> io::Result<File> {
    let (tell, told) = mpsc::channel();
    let path = path.to_owned();
    std::thread::spawn(move || tell.send(OpenOptions::new().append(true).open(path)));
    told.recv_timeout(PATIENCE).unwrap_or_else(|_| {
        let what = format!("nobody has read from the pipe for {PATIENCE:?}");
        Err(io::Error::new(io::ErrorKind::TimedOut, what))
    })
}

fn filled(
    file: &mut File,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::new(file);
    fill(&mut out)?;
    out.flush()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn target_follows_links_and_tells_streams_from_files() {
        let folder = tempfile::tempdir().unwrap();
        let here = |name: &str| folder.path().join(name);
        std::fs::write(here("file"), "").unwrap();
        for (link, to) in [("a", "file"), ("b", "a"), ("c", "new"), ("d", "d")] {
            symlink(to, here(link)).unwrap();
        }
        let of = |name: &str| Target::of(&here(name));
        let whole = |name: &str| Target::Whole(here(name));
        for (name, expected) in [("file", "file"), ("b", "file"), ("c", "new"), ("e", "e")] {
            assert_eq!(of(name).unwrap(), whole(expected), "{name}");
        }
        assert!(of("d").is_err(), "a circle");
        assert!(of("file/e").is_err(), "a file is no folder");
        for stream in ["/dev/null", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/2"] {
            assert_eq!(Target::of(Path::new(stream)).unwrap(), Target::Stream);
        }
    }
}
