//! Checkpoints, from which a stopped training resumes bit-identically.

use crate::config::{Config, ConfigError};
use crate::learn::model::{Learner, LearnerState};
use crate::record::crop::Crop;
use opsr::files::{FileError, Sealed, hex};
use opsr::regularise::{AttenuationTable, LEN};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// State of a training after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Hash of all that the training depends on, see [`Checkpoint::fingerprint`].
    pub fingerprint: String,
    /// Steps taken.
    pub step: u32,
    /// Step, loss and table of the best validation.
    pub best: Option<(u32, f32, AttenuationTable)>,
    /// Table at which paths that fold were linearised.
    pub anchor: AttenuationTable,
    /// Parameters and optimiser.
    pub state: LearnerState,
}

const FILE: Sealed = Sealed {
    kind: "training checkpoint",
    version: 3,
    most: 1 << 26,
};

/// Header of the file. Payload: factors of the anchor, factors of the best table if there is one, parameters,
/// optimiser.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    fingerprint: String,
    step: u32,
    best: Option<(u32, f32)>,
    /// Bytes of the parameters.
    parameters: usize,
}

impl Checkpoint {
    /// SHA-256 of all that a training depends on: settings, version, scenes, references. It excludes the number of
    /// steps, so that a finished training can be continued, and the interval of checkpoints.
    pub fn fingerprint<'a>(
        config: &Config,
        beta: f32,
        crops: impl Iterator<Item = &'a Crop>,
    ) -> Result<String, ConfigError> {
        let config = Config {
            steps: 1,
            beta: vec![beta],
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
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            fingerprint: self.fingerprint.clone(),
            step: self.step,
            best: self.best.as_ref().map(|b| (b.0, b.1)),
            parameters: self.state.parameters.len(),
        };
        FILE.save(path, &header, |out| {
            let best = self.best.iter().map(|b| &b.2);
            for gamma in [&self.anchor]
                .into_iter()
                .chain(best)
                .flat_map(|t| t.gammas.iter())
            {
                out.write_all(&gamma.to_le_bytes())?;
            }
            out.write_all(&self.state.parameters)?;
            out.write_all(&self.state.adam)
        })
    }

    /// Reads a checkpoint; fails for another fingerprint and for a damaged file.
    pub fn load(path: &Path, fingerprint: &str) -> Result<Self, FileError> {
        let (header, payload): (Header, _) = FILE.load(path)?;
        if header.fingerprint != fingerprint {
            let what = "belongs to a training with other settings, scenes or another version of the program";
            return Err(FileError::content(path, what));
        }
        let mut rest = payload.as_slice();
        let mut table =
            || table(&mut rest).ok_or_else(|| damaged(path, "not the factors of a table"));
        let anchor = table()?;
        let best = match header.best {
            Some((step, loss)) => Some((step, loss, table()?)),
            None => None,
        };
        let (parameters, adam) = rest
            .split_at_checked(header.parameters)
            .ok_or_else(|| damaged(path, "the parameters are cut short"))?;
        Ok(Self {
            fingerprint: header.fingerprint,
            step: header.step,
            best,
            anchor,
            state: LearnerState {
                parameters: parameters.into(),
                adam: adam.into(),
            },
        })
    }

    /// Sets a new learner to the state of this checkpoint; messages name `path`.
    pub fn restore(&self, learner: Learner, path: &Path) -> Result<Learner, FileError> {
        learner
            .restore(self.state.clone())
            .map_err(|e| damaged(path, e))
    }
}

/// Takes the factors of a table from the front of `bytes`; `None` if they are cut short or outside of [0, 1].
fn table(bytes: &mut &[u8]) -> Option<AttenuationTable> {
    let (factors, rest) = bytes.split_at_checked(4 * LEN)?;
    let mut table = AttenuationTable::constant(0.0);
    for (gamma, four) in table.gammas.iter_mut().zip(factors.as_chunks::<4>().0) {
        *gamma = f32::from_le_bytes(*four);
    }
    *bytes = rest;
    let sane = table.gammas.iter().all(|g| (0.0..=1.0).contains(g));
    sane.then_some(table)
}

fn damaged(path: &Path, problem: impl std::fmt::Display) -> FileError {
    FileError::content(path, format!("a damaged training checkpoint: {problem}"))
}
