//! Table files: `params/*.json`, with a versioned header that records how the table was learned.
//!
//! Factors read back bit-identical. A file of another version, with another number of bins or factors, or in another
//! order of classes is refused: a misread table could not be noticed in pictures.

use crate::{AttenuationTable, BINS, LEN, Lookup};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Version of the file format that this program writes and reads.
pub const VERSION: u32 = 1;

/// Value of the field `format` of every table file.
const FORMAT: &str = "opsr attenuation table";

/// Value of the field `order`: layout of the 1360 classes, see [`GammaIndex`](crate::GammaIndex). Part of the format.
pub(super) const ORDER: &str =
    "2, 3, 4, 5 vertices; levels as base-4 digits, the vertex nearest the camera first";

/// Size limit of a table file; larger files are refused.
const MAX_BYTES: u64 = 1 << 22;

/// Tables that this crate contains: name and text of the file.
const BUILT_IN: [(&str, &str); 2] = [
    ("beta-0.001", include_str!("../params/beta-0.001.json")),
    ("beta-0.05", include_str!("../params/beta-0.05.json")),
];

/// Number of list elements on a line of the file.
const PER_LINE: usize = 16;

/// Record of how a table was learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of the program.
    pub opsr: String,
    /// Definition of the loss with its constants.
    pub loss: String,
    /// Weight β of the variance in the loss.
    pub beta: f64,
    /// Samples per pixel that the table was learned for.
    pub spp: u32,
    /// Parameterisation of the table; tables that are learned now have `full`, one parameter for each factor.
    pub model: String,
    /// Optimiser and its constants.
    pub optimiser: String,
    /// Evaluation of loss and gradient.
    pub method: String,
    /// Number of optimiser steps taken.
    pub steps: u32,
    /// Seed of the recording.
    pub seed: u64,
    /// Training scenes with the SHA-256 of their files.
    pub scenes: Vec<(String, String)>,
    /// Initial value of every factor.
    pub start: f32,
    /// Number of recorded events of each class. A class without events has inherited the factor of its suffix.
    pub visits: Vec<u64>,
}

/// Contents of a table file.
#[derive(Clone, Debug, PartialEq)]
pub struct TableFile {
    /// Factors, look-up and scale.
    pub table: AttenuationTable,
    /// Record of the training; `None` for a table made by hand.
    pub provenance: Option<Provenance>,
}

/// Fields of the JSON document.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u32,
    levels: usize,
    order: String,
    lookup: Lookup,
    scale: f32,
    #[serde(default)]
    training: Option<Provenance>,
    gammas: Vec<f32>,
}

/// A table file that cannot be used. The text is complete, its cause included, and `source()` is `None`.
#[derive(Debug)]
pub struct TableError {
    /// The file.
    pub path: PathBuf,
    /// The fault.
    pub problem: TableProblem,
}

/// Fault of a table file.
#[derive(Debug)]
pub enum TableProblem {
    /// The file cannot be read.
    Read(io::Error),
    /// The file is no table of this version; the text names the field.
    Content(String),
}

impl TableError {
    fn content(path: &Path, problem: impl ToString) -> Self {
        Self {
            path: path.into(),
            problem: TableProblem::Content(problem.to_string()),
        }
    }
}

impl std::fmt::Display for TableError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.path.display();
        match &self.problem {
            TableProblem::Read(error) => write!(f, "{path}: cannot be read: {error}"),
            TableProblem::Content(text) => write!(f, "{path}: {text}"),
        }
    }
}

impl std::error::Error for TableError {}

/// Bytes of a file of at most [`MAX_BYTES`].
fn read(path: &Path) -> Result<Vec<u8>, TableError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|f| f.take(MAX_BYTES + 1).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 <= MAX_BYTES => Ok(bytes),
        Ok(_) => {
            let what = format!("more than {MAX_BYTES} bytes, too many for such a file");
            Err(TableError::content(path, what))
        }
        Err(error) => Err(TableError {
            path: path.into(),
            problem: TableProblem::Read(error),
        }),
    }
}

/// Adds the names of the built-in tables to the error of a file that does not exist.
fn with_names(mut error: TableError) -> TableError {
    if let TableProblem::Read(cause) = &mut error.problem
        && cause.kind() == std::io::ErrorKind::NotFound
    {
        let names = BUILT_IN.map(|(name, _)| name).join(", ");
        let what = format!("{cause}; tables by name are {names}");
        *cause = std::io::Error::new(cause.kind(), what);
    }
    error
}

impl TableFile {
    /// Reads a table file; `beta-0.001` and `beta-0.05` are tables that this crate contains, unless there are files of
    /// these names.
    pub fn load(path: &Path) -> Result<Self, TableError> {
        match BUILT_IN.iter().find(|(name, _)| path == Path::new(name)) {
            Some((_, text)) if !path.exists() => Self::parse(text.as_bytes(), path),
            _ => Self::parse(&read(path).map_err(with_names)?, path),
        }
    }

    /// True for the name of a table that this crate contains.
    pub fn is_built_in(name: &Path) -> bool {
        BUILT_IN.iter().any(|(own, _)| name == Path::new(own))
    }

    /// Parses the bytes of a table file; `path` appears in errors only.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, TableError> {
        let refused = |problem| TableError::content(path, problem);
        let syntax = |e| TableError::content(path, e);
        // Format and version are checked before the other fields, which may differ in a later version.
        #[derive(Deserialize)]
        struct Head {
            format: String,
            version: u32,
        }
        let Head { format, version } = serde_json::from_slice(bytes).map_err(syntax)?;
        if format != FORMAT {
            return Err(refused(format!("format: `{format}` is not `{FORMAT}`")));
        }
        if version != VERSION {
            return Err(refused(format!(
                "version: {version} where this program reads {VERSION}"
            )));
        }
        let document: Document = serde_json::from_slice(bytes).map_err(syntax)?;
        document.check().map_err(refused)?;
        let gammas: Box<[f32]> = document.gammas.into();
        let gammas = gammas.try_into().map_err(|rest: Box<[f32]>| {
            refused(format!("gammas: {} numbers, expected {LEN}", rest.len()))
        })?;
        Ok(Self {
            table: AttenuationTable::new(gammas, document.lookup, document.scale),
            provenance: document.training,
        })
    }

    /// Text of the file.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let provenance = self.provenance.as_ref();
        let document = Document {
            format: FORMAT.into(),
            version: VERSION,
            levels: BINS,
            order: ORDER.into(),
            lookup: self.table.lookup,
            scale: self.table.scale,
            training: provenance.map(|p| Provenance {
                visits: Vec::new(),
                ..p.clone()
            }),
            gammas: Vec::new(),
        };
        let mut text = serde_json::to_string_pretty(&document)?;
        // Long lists are written in rows, so that a file is readable and diffs line by line.
        if let Some(p) = provenance {
            text = text.replacen("\"visits\": []", &rows("visits", &p.visits)?, 1);
        }
        text = text.replacen(
            "\"gammas\": []",
            &rows("gammas", self.table.gammas.as_slice())?,
            1,
        );
        text.push('\n');
        Ok(text)
    }

    /// SHA-256 of everything a render depends on: factors, scale and look-up.
    pub fn digest(&self) -> [u8; 32] {
        let mut digest = hmac_sha256::Hash::new();
        for gamma in self.table.gammas.iter() {
            digest.update(gamma.to_le_bytes());
        }
        digest.update(self.table.scale.to_le_bytes());
        digest.update([self.table.lookup as u8]);
        digest.finalize()
    }
}

impl Document {
    /// Checks sizes and ranges; the error names the field.
    fn check(&self) -> Result<(), String> {
        if self.levels != BINS {
            return Err(format!("levels: {}, expected {BINS}", self.levels));
        }
        if self.order != ORDER {
            return Err(format!("order: `{}`, expected `{ORDER}`", self.order));
        }
        if self.gammas.len() != LEN {
            return Err(format!(
                "gammas: {} numbers, expected {LEN}",
                self.gammas.len()
            ));
        }
        if let Some(i) = (self.gammas.iter()).position(|g| !(0.0..=1.0).contains(g)) {
            return Err(format!("gammas[{i}]: {} is outside [0, 1]", self.gammas[i]));
        }
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return Err(format!("scale: {} is not a positive number", self.scale));
        }
        match &self.training {
            Some(p) if p.visits.len() != LEN => Err(format!(
                "training.visits: {} numbers, expected {LEN}",
                p.visits.len()
            )),
            _ => Ok(()),
        }
    }
}

/// JSON of a named list in rows of [`PER_LINE`] elements.
fn rows<T: Serialize>(name: &str, numbers: &[T]) -> Result<String, serde_json::Error> {
    let lines: Result<Vec<String>, _> = numbers
        .chunks(PER_LINE)
        .map(|row| {
            let row: Result<Vec<String>, _> = row.iter().map(serde_json::to_string).collect();
            row.map(|row| format!("    {}", row.join(", ")))
        })
        .collect();
    Ok(format!("\"{name}\": [\n{}\n  ]", lines?.join(",\n")))
}
