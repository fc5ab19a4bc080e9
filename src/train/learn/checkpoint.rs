//! Checkpoints, from which a stopped training resumes bit-identically.

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

/// Longest checkpoint that is read.
const MAX_BYTES: u64 = 1 << 26;

/// State of a training after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Hash of all that the training depends on, see [`Checkpoint::fingerprint`].
    pub fingerprint: String,
    /// Steps taken.
    pub step: u32,
    /// Validations since the best one.
    pub stale: u32,
    /// Step, loss and table of the best validation.
    pub best: Option<(u32, f32, AttenuationTable)>,
    /// Table at which paths that fold were linearised.
    pub anchor: AttenuationTable,
    /// Parameters and optimiser.
    pub state: LearnerState,
}

/// Errors of checkpoints.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("{path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is damaged or no checkpoint.
    #[error("{path}: not a checkpoint of a training: {problem}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// The checkpoint belongs to another training.
    #[error(
        "{path}: belongs to a training with other settings, scenes or another version of the program"
    )]
    Other {
        /// The file.
        path: PathBuf,
    },
}

/// The file, as JSON; byte strings in base 64.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckpointFile {
    format: String,
    fingerprint: String,
    step: u32,
    #[serde(rename = "looks")]
    stale: u32,
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
            self.stale,
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
    /// Hash of all that a training depends on: settings, version, scenes, references. The number of steps is not part
    /// of it, so that a finished training can be continued.
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
        let mut file = CheckpointFile {
            format: FORMAT.into(),
            fingerprint: self.fingerprint.clone(),
            step: self.step,
            stale: self.stale,
            best: self.best.as_ref().map(|b| (b.0, b.1)),
            best_table: self.best.as_ref().map(|b| bits(&b.2)),
            anchor: bits(&self.anchor),
            parameters: STANDARD.encode(&self.state.parameters),
            adam: STANDARD.encode(&self.state.adam),
            sha256: String::new(),
        };
        file.sha256 = file.checksum();
        let text = serde_json::to_vec(&file).map_err(|e| damaged(path, e))?;
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
        let file: CheckpointFile = serde_json::from_slice(&text).map_err(|e| damaged(path, e))?;
        if file.format != FORMAT || file.sha256 != file.checksum() {
            return Err(damaged(path, "the checksum is wrong"));
        }
        if file.fingerprint != fingerprint {
            return Err(CheckpointError::Other { path: path.into() });
        }
        let bytes = |text: &str| STANDARD.decode(text).map_err(|e| damaged(path, e));
        let table = |text: &str| {
            table(&bytes(text)?).ok_or_else(|| damaged(path, "not the factors of a table"))
        };
        let best = match (file.best, &file.best_table) {
            (Some((step, loss)), Some(text)) => Some((step, loss, table(text)?)),
            (None, None) => None,
            _ => return Err(damaged(path, "half of a best table")),
        };
        Ok(Self {
            fingerprint: file.fingerprint,
            step: file.step,
            stale: file.stale,
            best,
            anchor: table(&file.anchor)?,
            state: LearnerState {
                parameters: bytes(&file.parameters)?,
                adam: bytes(&file.adam)?,
            },
        })
    }

    /// Sets a new learner to the state of this checkpoint; messages name `path`.
    pub fn restore(&self, learner: Learner, path: &Path) -> Result<Learner, CheckpointError> {
        learner
            .restore(self.state.clone())
            .map_err(|e| damaged(path, e))
    }
}

/// The factors of a table in base 64.
fn bits(table: &AttenuationTable) -> String {
    let bytes: Vec<u8> = table.gammas.iter().flat_map(|g| g.to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

/// Inverse of [`bits`], after base 64.
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
