//! Faults of a file with their place, and warnings.

use crate::files::{FileError, Problem};
use crate::memory::Shortage;
use std::path::Path;

/// A fault without its file.
#[derive(Debug)]
pub(super) struct Fault(Problem);

/// Result of reading one part of a file.
pub(super) type Result<T> = std::result::Result<T, Fault>;

/// A fault at a place, such as `accessors[3]`.
pub(super) fn fault(place: impl Into<String>, what: impl Into<String>) -> Fault {
    Fault(Problem::content(format!(
        "{}: {}",
        place.into(),
        what.into()
    )))
}

impl From<Shortage> for Fault {
    fn from(shortage: Shortage) -> Self {
        Self(Problem::Memory(shortage))
    }
}

impl Fault {
    /// The fault as an error of a file.
    pub(super) fn of(self, path: &Path) -> FileError {
        self.0.at(path)
    }
}

/// The place of the `i`-th element of a list, with its name if it has one.
pub(super) fn place(list: &str, i: usize, name: Option<&String>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{list}[{i}] (`{name}`)"),
        _ => format!("{list}[{i}]"),
    }
}

/// Warnings for the user, each said once.
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
