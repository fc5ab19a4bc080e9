//! A stopped training, from which it goes on to the bit.

use crate::files;
use crate::files::hex;
use crate::regularise::{AttenuationTable, LEN};
use crate::train::config::{Config, ConfigError};
use crate::train::learn::model::{Learner, LearnerState};
use crate::train::record::crop::Crop;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Larger files are not checkpoints of a training.
const MAX_BYTES: u64 = 1 << 26;

/// What a training needs to go on.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// What it belongs to.
    pub fingerprint: String,
    /// Steps taken.
    pub step: u32,
    /// Looks at the validation scenes since the best one.
    pub looks: u32,
    /// Step, loss and table of the best look.
    pub best: Option<(u32, f32, AttenuationTable)>,
    /// The table that paths which fold were linearised at.
    pub anchor: AttenuationTable,
    /// Parameters and optimiser.
    pub state: LearnerState,
}

/// Why a checkpoint could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("{path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Damaged, or not a checkpoint.
    #[error("{path}: not a checkpoint of a training: {problem}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A checkpoint of other settings or scenes.
    #[error(
        "{path}: belongs to a training with other settings, scenes or another version of the program"
    )]
    Other {
        /// The file.
        path: PathBuf,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckpointFile {
    format: String,
    fingerprint: String,
    step: u32,
    looks: u32,
    best: Option<(u32, f32)>,
    best_table: Option<String>,
    anchor: String,
    parameters: String,
    adam: String,
    sha256: String,
}

const FORMAT: &str = "opsr training checkpoint 1";

impl CheckpointFile {
    fn checksum(&self) -> String {
        let text = format!(
            "{} {} {} {} {:?} {:?} {} {} {}",
            self.format,
            self.fingerprint,
            self.step,
            self.looks,
            self.best,
            self.best_table,
            self.anchor,
            self.parameters,
            self.adam
        );
        hex(&Sha256::digest(text.as_bytes()))
    }
}

impl Checkpoint {
    /// What a training depends on, as a hash: settings, version, scenes, references. The number of steps is not part of
    /// it: a finished training can be gone on with.
    pub fn fingerprint<'a>(
        config: &Config,
        beta: f32,
        crops: impl Iterator<Item = &'a Crop>,
    ) -> Result<String, ConfigError> {
        let config = Config {
            steps: 1,
            beta: vec![beta],
            patience: 0,
            checkpoint_every: 1,
            ..config.clone()
        };
        let mut digest = Sha256::new();
        digest.update(env!("CARGO_PKG_VERSION"));
        digest.update(config.to_toml()?);
        for crop in crops {
            digest.update(&crop.name);
            digest.update(crop.digest);
            for value in crop.reference.iter().flatten() {
                digest.update(value.to_le_bytes());
            }
        }
        Ok(hex(&digest.finalize()))
    }

    /// Writes the file, whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let mut document = CheckpointFile {
            format: FORMAT.into(),
            fingerprint: self.fingerprint.clone(),
            step: self.step,
            looks: self.looks,
            best: self.best.as_ref().map(|b| (b.0, b.1)),
            best_table: self.best.as_ref().map(|b| bits(&b.2)),
            anchor: bits(&self.anchor),
            parameters: STANDARD.encode(&self.state.parameters),
            adam: STANDARD.encode(&self.state.adam),
            sha256: String::new(),
        };
        document.sha256 = document.checksum();
        let text = serde_json::to_vec(&document).map_err(|e| damaged(path, e))?;
        files::write_bytes(path, &text).map_err(|source| CheckpointError::Write {
            path: path.into(),
            source,
        })
    }

    /// Reads a checkpoint of the training with this fingerprint.
    pub fn load(path: &Path, fingerprint: &str) -> Result<Self, CheckpointError> {
        let text = files::read(path, MAX_BYTES).map_err(|source| CheckpointError::Read {
            path: path.into(),
            source,
        })?;
        let document: CheckpointFile =
            serde_json::from_slice(&text).map_err(|e| damaged(path, e))?;
        if document.format != FORMAT || document.sha256 != document.checksum() {
            return Err(damaged(path, "the checksum is wrong"));
        }
        if document.fingerprint != fingerprint {
            return Err(CheckpointError::Other { path: path.into() });
        }
        let bytes = |text: &str| STANDARD.decode(text).map_err(|e| damaged(path, e));
        let table = |text: &str| {
            table(&bytes(text)?).ok_or_else(|| damaged(path, "not the factors of a table"))
        };
        let best = match (document.best, &document.best_table) {
            (Some((step, loss)), Some(text)) => Some((step, loss, table(text)?)),
            (None, None) => None,
            _ => return Err(damaged(path, "half of a best table")),
        };
        Ok(Self {
            fingerprint: document.fingerprint,
            step: document.step,
            looks: document.looks,
            best,
            anchor: table(&document.anchor)?,
            state: LearnerState {
                parameters: bytes(&document.parameters)?,
                adam: bytes(&document.adam)?,
            },
        })
    }

    /// Sets a fresh learner to where this one stood; `path` is for messages.
    pub fn restore(&self, learner: Learner, path: &Path) -> Result<Learner, CheckpointError> {
        learner
            .restore(self.state.clone())
            .map_err(|e| damaged(path, e))
    }
}

/// The factors of a table, to the bit.
fn bits(table: &AttenuationTable) -> String {
    let bytes: Vec<u8> = table.gammas.iter().flat_map(|g| g.to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

/// What [`bits`] wrote.
fn table(bytes: &[u8]) -> Option<AttenuationTable> {
    let mut table = AttenuationTable::constant(0.0);
    let (chunks, []) = bytes.as_chunks::<4>() else {
        return None;
    };
    for (gamma, chunk) in table.gammas.iter_mut().zip(chunks) {
        *gamma = f32::from_le_bytes(*chunk);
    }
    let sane = table.gammas.iter().all(|g| (0.0..=1.0).contains(g));
    (chunks.len() == LEN && sane).then_some(table)
}

fn damaged(path: &Path, problem: impl std::fmt::Display) -> CheckpointError {
    CheckpointError::Damaged {
        path: path.into(),
        problem: files::briefly(problem),
    }
}
