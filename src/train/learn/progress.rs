//! The state of a learning between two steps.

use crate::regularise::{AttenuationTable, Lookup};
use crate::train::TrainError;
use crate::train::learn::checkpoint::Checkpoint;
use crate::train::learn::crop_set::CropSet;
use crate::train::learn::model::Learner;
use crate::train::learn::session::LogEntry;
use std::path::Path;

/// Where the learning of one table stands.
pub(in crate::train) struct TrainingState {
    pub(in crate::train) learner: Learner,
    pub(in crate::train) step: u32,
    /// Steps left out since the start or the resumption.
    pub(in crate::train) skipped: u32,
    pub(in crate::train) log: Vec<LogEntry>,
    pub(in crate::train) best: Option<(u32, f32, AttenuationTable)>,
    /// Looks at the validation scenes since the best one.
    pub(in crate::train) looks: u32,
}

impl TrainingState {
    pub(in crate::train) fn new(learner: Learner) -> Self {
        Self {
            learner,
            step: 0,
            skipped: 0,
            log: Vec::new(),
            best: None,
            looks: 0,
        }
    }

    pub(in crate::train) fn is_over(&self, patience: u32) -> bool {
        patience > 0 && self.looks >= patience
    }

    /// Goes on from a checkpoint; `path` is for messages.
    pub(in crate::train) fn resume(
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

    pub(in crate::train) fn checkpoint(
        &self,
        fingerprint: &str,
        training: &CropSet,
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
