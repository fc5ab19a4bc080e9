//! Files that only one process at a time may use.

use super::{FileError, Problem, Target};
use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// Exclusive use of a file or a folder: a lock on a file beside it that ends in `.lock`. The system releases the lock
/// when the process ends or is killed. Drop removes the file; a `.lock` file without a lock is no claim.
#[derive(Debug)]
pub struct Claim {
    /// The locked file; `None` for streams, and where the file system has no locks.
    held: Option<(File, PathBuf)>,
}

impl Claim {
    /// Claims a file or a folder; fails if another process has it.
    pub fn on(path: &Path) -> Result<Self, FileError> {
        let failed = |e| Problem::Write(e).at(path);
        let Target::Whole(target) = Target::of(path).map_err(failed)? else {
            return Ok(Self { held: None });
        };
        let mut name = OsString::from(target);
        name.push(".lock");
        let beside = PathBuf::from(name);
        loop {
            let options = &mut File::options();
            let file = options.write(true).create(true).truncate(false);
            let file = file.open(&beside).map_err(failed)?;
            match file.try_lock() {
                Ok(()) if is_at(&file, &beside) => {
                    let held = Some((file, beside));
                    return Ok(Self { held });
                }
                // The owner dropped its claim and removed the file after this one opened it: try again.
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Problem::InUse.at(path));
                }
                Err(TryLockError::Error(_)) => {
                    let _ = std::fs::remove_file(&beside);
                    return Ok(Self { held: None });
                }
            }
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if let Some((_, beside)) = &self.held {
            // Removed while it is locked, so that no other claim can be on it.
            let _ = std::fs::remove_file(beside);
        }
    }
}

/// True if the open file is still the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |m: io::Result<std::fs::Metadata>| m.ok().map(|m| (m.dev(), m.ino()));
    id(file.metadata()) == id(path.metadata())
}

/// True: elsewhere an open file cannot be removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claim_is_one_at_a_time_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("night.ckpt");
        let first = Claim::on(&path).unwrap();
        let error = Claim::on(&path).unwrap_err();
        assert!(error.to_string().contains("another process"), "{error}");
        let other = Claim::on(&folder.path().join("day.ckpt")).unwrap();
        drop((first, other));
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
        // A file left by a killed process is no claim.
        std::fs::write(folder.path().join("night.ckpt.lock"), "").unwrap();
        Claim::on(&path).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }

    #[test]
    fn claims_of_many_threads_are_never_two_at_once() {
        use std::sync::atomic::{AtomicU32, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("night.ckpt");
        let (inside, had) = (AtomicU32::new(0), AtomicU32::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..500 {
                        let Ok(_claim) = Claim::on(&path) else {
                            continue;
                        };
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                        inside.fetch_sub(1, Ordering::SeqCst);
                        had.fetch_add(1, Ordering::SeqCst);
                    }
                });
            }
        });
        assert!(had.into_inner() > 100);
    }
}
