//! Writes that leave either the old file or the new one, never half of one.

use super::{FileError, Problem};
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, SystemTime};

/// Destination of a write after symbolic links are followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// A regular file, or a free name: replaced as a whole.
    Whole(PathBuf),
    /// A device, a pipe, or an open stream of a process such as `/dev/stdout`: written into, never replaced.
    Stream,
}

impl Target {
    /// The destination that a path names; a dangling link names the file to be made.
    pub(crate) fn of(path: &Path) -> io::Result<Self> {
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
                // Writing to a folder fails later, with the system's message.
                let whole = kind.is_file() || kind.is_dir();
                return Ok(if whole {
                    Self::Whole(path)
                } else {
                    Self::Stream
                });
            }
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            // Links to open streams have targets that are not paths.
            if folder.canonicalize().is_ok_and(|f| f.starts_with("/proc")) {
                return Ok(Self::Stream);
            }
            path = folder.join(path.read_link()?);
        }
        Err(io::Error::other("too many symbolic links"))
    }
}

/// Writes a temporary file in the same folder, and renames it to `path` once all of it is on disk.
///
/// A stopped run or a full disk leaves the old file as it was. Symbolic links stay, and their targets are replaced.
/// Devices and pipes receive the bytes once all of them are known.
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
    let prefix = prefix(&path);
    remove_abandoned(folder, &prefix);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
    // Temporary files are private by default; a result is an ordinary file, so the umask decides.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    // The lock marks a file that is being written. Without support for locks, abandoned files are not removed.
    let _ = file.as_file().try_lock();
    filled(file.as_file_mut(), fill)?;
    file.as_file().sync_all()?;
    file.persist(&path).map_err(|e| e.error)?;
    Ok(())
}

/// End of a temporary file's name.
const SUFFIX: &str = ".part";

/// Number of random characters of a temporary file's name.
const RANDOM: usize = 6;

/// Age from which a temporary file without a lock is taken as left by a killed process.
const ABANDONED: Duration = Duration::from_secs(60);

/// Beginning of the names of a file's temporary files: hidden, and cut to the length that names can have.
fn prefix(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let short: String = name.chars().take(50).collect();
    format!(".{short}.")
}

/// Removes the temporary files of a name that killed processes left.
fn remove_abandoned(folder: &Path, prefix: &str) {
    let length = prefix.len() + RANDOM + SUFFIX.len();
    let is_temporary = |name: &OsString| {
        let name = name.to_string_lossy();
        name.len() == length && name.starts_with(prefix) && name.ends_with(SUFFIX)
    };
    let Ok(entries) = folder.read_dir() else {
        return;
    };
    for entry in entries.flatten().filter(|e| is_temporary(&e.file_name())) {
        let age = |m: std::fs::Metadata| SystemTime::now().duration_since(m.modified().ok()?).ok();
        let (path, metadata) = (entry.path(), entry.metadata());
        let is_file = metadata.as_ref().is_ok_and(std::fs::Metadata::is_file);
        let is_old = metadata.ok().and_then(age).is_some_and(|a| a > ABANDONED);
        if is_file && is_old && File::open(&path).is_ok_and(|f| f.try_lock().is_ok()) {
            // Best effort: a file that cannot be removed stays.
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Appends to a stream.
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

/// Time limit for another process to open a pipe for reading.
const PATIENCE: Duration = Duration::from_secs(10);

/// Opens a stream. Opening a pipe blocks until another process reads from it, which may be never.
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
mod tests;
