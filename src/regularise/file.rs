//! Tables as files: `params/*.json`, with a versioned header that says how the table was learned.
//!
//! Factors are written so that they read back to the bit. A file of another version, with another number of levels or
//! of factors, or in another order of classes is refused: a table that is read wrongly still makes pretty pictures.

use super::{AttenuationTable, LEN, LEVELS, Lookup};
use crate::files::{self, FileError};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// Version of the format that this program writes and reads.
pub const VERSION: u32 = 1;

/// What the first field of every table says.
const FORMAT: &str = "opsr attenuation table";

/// How the 1360 classes are laid out; see [`GammaIndex`](super::GammaIndex).
pub(super) const ORDER: &str =
    "2, 3, 4, 5 vertices; levels as base-4 digits, the vertex nearest the camera first";

/// Larger files are not tables.
const MAX_BYTES: u64 = 1 << 22;

/// Numbers on a line of the file.
const PER_LINE: usize = 16;

/// How a table was learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of the program.
    pub opsr: String,
    /// The definition of the loss with its constants.
    pub loss: String,
    /// Weight of the variance in the loss.
    pub beta: f64,
    /// Samples per pixel that the table was learned for.
    pub spp: u32,
    /// Shape of the table that was learned: every factor free, or additive in (position, level).
    pub model: String,
    /// Optimiser and its constants.
    pub optimiser: String,
    /// How loss and gradient were evaluated.
    pub method: String,
    /// Optimiser steps taken.
    pub steps: u32,
    /// Seed of the recording.
    pub seed: u64,
    /// Training scenes with the SHA-256 of their files.
    pub scenes: Vec<(String, String)>,
    /// Where each factor started.
    pub start: f32,
    /// Events per class in the recording. Classes never visited inherited from their suffix.
    pub visits: Vec<u64>,
}

/// A table and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct TableFile {
    /// The factors, their look-up and their scale.
    pub table: AttenuationTable,
    /// How they were learned; `None` for a table made by hand.
    pub provenance: Option<Provenance>,
}

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

impl TableFile {
    /// Reads a table.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::parse(&files::read(path, MAX_BYTES)?, path)
    }

    /// Reads a table from the bytes of a file; `path` is for messages.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, FileError> {
        let refused = |problem| FileError::content(path, problem);
        let syntax = |e| FileError::content(path, e);
        // The version first: a later one may have other fields.
        #[derive(Deserialize)]
        struct Head {
            format: String,
            version: u32,
        }
        let head: Head = serde_json::from_slice(bytes).map_err(syntax)?;
        if head.format != FORMAT {
            return Err(refused(format!(
                "format: `{}` is not `{FORMAT}`",
                head.format
            )));
        }
        if head.version != VERSION {
            return Err(refused(format!(
                "version: {} where this program reads {VERSION}",
                head.version
            )));
        }
        let document: Document = serde_json::from_slice(bytes).map_err(syntax)?;
        document.check().map_err(refused)?;
        let gammas: Box<[f32]> = document.gammas.into();
        let gammas = gammas.try_into().map_err(|rest: Box<[f32]>| {
            refused(format!("gammas: {} numbers, expected {LEN}", rest.len()))
        })?;
        Ok(Self {
            table: AttenuationTable {
                gammas,
                lookup: document.lookup,
                scale: document.scale,
            },
            provenance: document.training,
        })
    }

    /// Writes the table, whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let text = self.to_json().map_err(|e| FileError::content(path, e))?;
        files::write_bytes(path, text)
    }

    /// The text of the file.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let provenance = self.provenance.as_ref();
        let document = Document {
            format: FORMAT.into(),
            version: VERSION,
            levels: LEVELS,
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
        // The long lists in rows: a table fits on some screens and diffs line by line.
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

    /// SHA-256 of what a render depends on: factors, look-up and scale.
    pub fn digest(&self) -> [u8; 32] {
        let mut digest = Sha256::new();
        for gamma in self.table.gammas.iter() {
            digest.update(gamma.to_le_bytes());
        }
        digest.update(self.table.scale.to_le_bytes());
        digest.update([self.table.lookup as u8]);
        digest.finalize().into()
    }
}

impl Document {
    fn check(&self) -> Result<(), String> {
        if self.levels != LEVELS {
            return Err(format!("levels: {}, expected {LEVELS}", self.levels));
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

/// `"name": [` and the numbers, some on each line.
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
