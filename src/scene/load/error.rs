//! What can be wrong with a file.

use std::path::{Path, PathBuf};

/// Why a scene could not be loaded; the message names the file and the place in it.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file breaks the rules of glTF, or asks for more than this loader can do.
    #[error("{}: {place}: {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where in the file: a JSON path such as `accessors[3]`, with the name where there is one.
        place: String,
        /// What is wrong there.
        what: String,
    },
    /// The file cannot be shown without an extension that this loader does not know.
    #[error("{}: extensionsRequired: {name} is not supported", path.display())]
    Extension {
        /// The file.
        path: PathBuf,
        /// Name of the extension.
        name: String,
    },
}

/// An error before it knows its file.
#[derive(Debug)]
pub(super) enum Fault {
    Invalid { place: String, what: String },
    Extension { name: String },
}

/// Of everything that reads one part of a file.
pub(super) type Result<T> = std::result::Result<T, Fault>;

/// Something wrong at a place.
pub(super) fn fault(place: impl Into<String>, what: impl Into<String>) -> Fault {
    Fault::Invalid {
        place: place.into(),
        what: what.into(),
    }
}

impl Fault {
    /// The error as the caller of the loader sees it.
    pub(super) fn of(self, path: &Path) -> LoadError {
        let path = path.to_owned();
        match self {
            Self::Invalid { place, what } => LoadError::Invalid { path, place, what },
            Self::Extension { name } => LoadError::Extension { path, name },
        }
    }
}

/// The place of the `i`-th thing of a list, with its name if it has one.
pub(super) fn place(list: &str, i: usize, name: Option<&String>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{list}[{i}] (`{name}`)"),
        _ => format!("{list}[{i}]"),
    }
}

/// Lines for the user, each said once.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    lines: Vec<String>,
    said: std::collections::HashSet<String>,
}

impl Warnings {
    pub(super) fn say(&mut self, line: impl Into<String>) {
        let line = line.into();
        if self.said.insert(line.clone()) {
            self.lines.push(line);
        }
    }

    pub(super) fn into_lines(self) -> Vec<String> {
        self.lines
    }
}
