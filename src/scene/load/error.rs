//! Faults of a file with their place, and warnings.

use crate::files::{FileError, Problem};
use crate::memory::Shortage;
use std::path::Path;

/// A fault without its file.
#[derive(Debug)]
pub struct Fault(Problem);

/// Result of reading one part of a file.
pub type Result<T> = std::result::Result<T, Fault>;

/// A fault at a place, such as `accessors[3]`.
pub fn fault(place: impl Into<String>, what: impl Into<String>) -> Fault {
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
    pub fn of(self, path: &Path) -> FileError {
        self.0.at(path)
    }
}

/// The place of the `i`-th element of a list, with its name if it has one.
pub(crate) fn place(list: &str, i: usize, name: Option<&String>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{list}[{i}] (`{name}`)"),
        _ => format!("{list}[{i}]"),
    }
}

/// Warnings for the user without duplicates; the same warning about several elements is one line.
#[derive(Debug, Default)]
pub struct Warnings {
    lines: Vec<Line>,
    said: std::collections::HashSet<String>,
}

#[derive(Debug)]
enum Line {
    Plain(String),
    /// Kind and names of elements, and their common problem.
    Group(&'static str, Vec<String>, String),
}

/// Number of names that a line lists.
const NAMES: usize = 3;

impl Warnings {
    /// Adds a warning, once.
    pub(crate) fn say(&mut self, line: impl Into<String>) {
        let line = line.into();
        if self.said.insert(line.clone()) {
            self.lines.push(Line::Plain(line));
        }
    }

    /// Warns of an element of a kind, a plural such as `materials`: elements with the same problem share a line.
    pub fn group(&mut self, kind: &'static str, name: impl Into<String>, what: &str) {
        let name = name.into();
        if !self.said.insert(format!("{kind} {name} {what}")) {
            return;
        }
        let same =
            |line: &&mut Line| matches!(line, Line::Group(k, _, w) if *k == kind && w == what);
        match self.lines.iter_mut().find(same) {
            Some(Line::Group(_, names, _)) => names.push(name),
            _ => (self.lines).push(Line::Group(kind, vec![name], what.into())),
        }
    }

    /// The warnings, one line each.
    pub fn into_lines(self) -> Vec<String> {
        let text = |line| match line {
            Line::Plain(text) => text,
            Line::Group(_, names, what) if names.len() == 1 => format!("{}: {what}", names[0]),
            Line::Group(kind, names, what) => {
                let listed = names[..names.len().min(NAMES)].join(", ");
                let more = if names.len() > NAMES { " …" } else { "" };
                format!("{} {kind}: {what}: {listed}{more}", names.len())
            }
        };
        self.lines.into_iter().map(text).collect()
    }
}
