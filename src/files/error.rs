//! Errors of files.

use crate::memory::Shortage;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

/// A file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct FileError {
    /// The file, or the folder.
    pub path: PathBuf,
    /// The failed operation with its cause.
    pub problem: Problem,
}

/// The operation on a file that failed, and its cause. No field is a `source()`, because the text contains the cause.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The file cannot be read, or is too long.
    #[error("cannot be read: {0}")]
    Read(io::Error),
    /// The file cannot be written or the folder not made.
    #[error("cannot be written: {0}")]
    Write(io::Error),
    /// Another process works on the file.
    #[error("another process is using it")]
    InUse,
    /// The content needs more memory than there is.
    #[error("{0}")]
    Memory(Shortage),
    /// The content is damaged, not supported, or invalid; the text names the place.
    #[error("{0}")]
    Content(String),
}

impl Problem {
    /// A problem with the content; a text that quotes too much of the file is cut.
    pub(crate) fn content(problem: impl Display) -> Self {
        Self::Content(super::briefly(problem))
    }

    /// The problem of this file.
    pub fn at(self, path: &Path) -> FileError {
        FileError {
            path: path.to_owned(),
            problem: self,
        }
    }
}

impl FileError {
    /// A file whose content is damaged, not supported, or invalid.
    pub fn content(path: &Path, problem: impl Display) -> Self {
        Problem::content(problem).at(path)
    }

    /// True if the output failed rather than the input.
    pub fn is_write(&self) -> bool {
        matches!(self.problem, Problem::Write(_) | Problem::InUse)
    }

    /// True if there is no such file.
    pub fn is_missing(&self) -> bool {
        matches!(&self.problem, Problem::Read(e) if e.kind() == io::ErrorKind::NotFound)
    }
}
