//! The state of a learning between two steps.

use super::TrainError;
use super::checkpoint::Checkpoint;
use super::model::Learner;
use super::session::Entry;
use super::set::Set;
use crate::regularise::{AttenuationTable, Lookup};
use std::path::Path;

/// Where the learning of one table stands.
pub(super) struct Progress {
    pub(super) learner: Learner,
    pub(super) step: u32,
    /// Steps left out since the start or the resumption.
    pub(super) skipped: u32,
    pub(super) log: Vec<Entry>,
    pub(super) best: Option<(u32, f32, AttenuationTable)>,
    /// Looks at the validation scenes since the best one.
    pub(super) looks: u32,
}

impl Progress {
    pub(super) fn new(learner: Learner) -> Self {
        Self {
            learner,
            step: 0,
            skipped: 0,
            log: Vec::new(),
            best: None,
            looks: 0,
        }
    }

    pub(super) fn is_over(&self, patience: u32) -> bool {
        patience > 0 && self.looks >= patience
    }

    /// Goes on from a checkpoint; `path` is for messages.
    pub(super) fn resume(
        self,
        checkpoint: Checkpoint,
        lookup: Lookup,
        path: &Path,
    ) -> Result<Self, TrainError> {
        let with_lookup = |table| AttenuationTable { lookup, ..table };
        Ok(Self {
            learner: checkpoint.restore(self.learner, path)?,
            step: checkpoint.step,
            skipped: 0,
            best: (checkpoint.best).map(|(step, loss, table)| (step, loss, with_lookup(table))),
            looks: checkpoint.looks,
            log: Vec::new(),
        })
    }

    pub(super) fn checkpoint(
        &self,
        fingerprint: &str,
        training: &Set,
    ) -> Result<Checkpoint, TrainError> {
        Ok(Checkpoint {
            fingerprint: fingerprint.into(),
            step: self.step,
            looks: self.looks,
            best: self.best.clone(),
            anchor: (training.anchor.clone()).unwrap_or_else(|| AttenuationTable::constant(0.5)),
            state: self.learner.to_bytes()?,
        })
    }
}
