//! The outer loop: learns one table for one β.

use crate::config::{Config, ConfigError, Evaluation};
use crate::learn::checkpoint::Checkpoint;
use crate::learn::crop_set::CropSet;
use crate::learn::loss::{CropLoss, LossBackend, mean_loss};
use crate::learn::model::Learner;
use crate::learn::prior::Prior;
use crate::record::crop::DatasetError;
use opsr::files::FileError;
use opsr::memory::Shortage;
use opsr::regularise::AttenuationTable;
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Largest derivative of a usable gradient. Adam squares it in single precision, and a moment of infinity would freeze
/// its factor for ever.
const MAX_DERIVATIVE: f64 = 1e18;

/// Number of steps without a usable gradient after which a training fails.
const MAX_SKIPPED: u32 = 100;

/// Errors of a training.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Scenes or references cannot be used.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A checkpoint cannot be read or written.
    #[error(transparent)]
    Checkpoint(#[from] FileError),
    /// The recordings do not fit into memory.
    #[error(transparent)]
    Memory(#[from] Shortage),
    /// The optimiser's state cannot be stored.
    #[error("optimiser state: {0}")]
    State(String),
    /// There is nothing to learn from.
    #[error("{0}")]
    Empty(String),
    /// Too many steps were skipped.
    #[error(
        "step {step}: the loss or its gradient was not finite for the {skipped}th time; the checkpoint holds the \
         last good state"
    )]
    NotFinite {
        /// Steps taken.
        step: u32,
        /// Steps skipped.
        skipped: u32,
    },
}

/// A line of the log: a validation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogEntry {
    /// Steps taken.
    pub step: u32,
    /// Mean loss of the training crops.
    pub loss: f32,
    /// Mean loss of the validation crops, with unvisited classes inherited.
    pub validation: Option<f32>,
    /// The loss of each training crop.
    pub crops: Vec<CropLoss>,
    /// The loss of each validation crop.
    pub validation_crops: Vec<CropLoss>,
    /// Seconds since the training started or resumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
}

/// Callback at every step with its number, its loss and, after a validation, the log entry; `Break` stops the training.
/// The last call, after all steps, has a loss of NaN.
pub type StepCallback<'a> = &'a mut dyn FnMut(u32, f32, Option<&LogEntry>) -> ControlFlow<()>;

/// Result of a training for one β.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Initial value of all factors.
    pub start: f32,
    /// The learned table, unvisited classes inherited.
    pub table: AttenuationTable,
    /// Step and table of the best validation.
    pub best: Option<(u32, AttenuationTable)>,
    /// Steps taken.
    pub steps: u32,
    /// Steps that left table and optimiser unchanged, because loss or gradient was not finite or too large.
    pub skipped: u32,
    /// The log.
    pub log: Vec<LogEntry>,
    /// True if the listener stopped it.
    pub stopped: bool,
}

/// State of the loop between two steps.
pub(super) struct OuterLoop<'a> {
    config: &'a Config,
    training: &'a mut CropSet,
    validation: &'a mut CropSet,
    beta: f32,
    start: f32,
    /// Hash of all that the training depends on.
    fingerprint: String,
    /// File of the checkpoint.
    path: Option<PathBuf>,
    /// Table at which the training crops are first linearised.
    anchor: AttenuationTable,
    learner: Learner,
    step: u32,
    /// Steps skipped since the training started or resumed.
    skipped: u32,
    /// Step, loss and table of the best validation.
    best: Option<(u32, f32, AttenuationTable)>,
    log: Vec<LogEntry>,
    clock: Instant,
}

impl<'a> OuterLoop<'a> {
    /// The state before the first step. Checkpoints go to `last.ckpt` in `folder`.
    pub(super) fn new(
        config: &'a Config,
        training: &'a mut CropSet,
        validation: &'a mut CropSet,
        beta: f32,
        folder: Option<&Path>,
    ) -> Result<Self, TrainError> {
        let start = match config.start > 0.0 {
            true => config.start,
            false => training.best_constant(beta, config.lookup),
        };
        Ok(Self {
            fingerprint: Checkpoint::fingerprint(config, beta, training.crops())?,
            learner: Learner::new(config.optimiser, config.step_size(), config.lookup, start),
            path: folder.map(|f| f.join("last.ckpt")),
            anchor: config.constant(start),
            step: 0,
            skipped: 0,
            best: None,
            log: Vec::new(),
            clock: Instant::now(),
            config,
            training,
            validation,
            beta,
            start,
        })
    }

    /// Continues from the checkpoint in the folder; without a folder, from the first step.
    pub(super) fn resume(self) -> Result<Self, TrainError> {
        let Some(path) = &self.path else {
            return Ok(self);
        };
        let checkpoint = Checkpoint::load(path, &self.fingerprint)?;
        let lookup = self.config.lookup;
        let with_lookup = |table| AttenuationTable { lookup, ..table };
        Ok(Self {
            learner: checkpoint.restore(self.learner, path)?,
            step: checkpoint.step,
            best: checkpoint
                .best
                .map(|(step, loss, table)| (step, loss, with_lookup(table))),
            anchor: with_lookup(checkpoint.anchor),
            ..self
        })
    }

    /// Takes the remaining steps, with validations and checkpoints.
    pub(super) fn run(mut self, listen: StepCallback<'_>) -> Result<Outcome, TrainError> {
        let config = self.config;
        let backend = match config.method {
            Evaluation::Tabulated => LossBackend::Scalar,
            Evaluation::Replay => LossBackend::Autodiff,
        };
        let objective = self.training.objective(self.beta, backend);
        let prior = Prior::new(config.prior, &self.training.visits());
        self.training.anchor(self.anchor.clone());
        let mut stopped = false;
        while self.step < config.steps {
            let table = self.learner.table();
            let (loss, mut gradient) = self.training.gradient(&objective, &table);
            prior.add(&table.gammas, &mut gradient);
            let due = self.step.is_multiple_of(config.validate_every);
            if due {
                self.validate();
            }
            stopped = listen(self.step, loss, self.log.last().filter(|_| due)).is_break();
            if stopped {
                break;
            }
            if loss.is_finite() && gradient.iter().all(|g| g.abs() < MAX_DERIVATIVE) {
                self.learner.step(&gradient);
            } else {
                self.skipped += 1;
            }
            self.step += 1;
            if self.skipped >= MAX_SKIPPED {
                self.save()?;
                let Self { step, skipped, .. } = self;
                return Err(TrainError::NotFinite { step, skipped });
            }
            if self.step.is_multiple_of(config.checkpoint_every) {
                self.save()?;
            }
        }
        // Saved before the last validation, which is not part of a training that continues from this checkpoint.
        self.save()?;
        if !stopped {
            self.validate();
            // The training has ended, so that the answer does not matter.
            let _ = listen(self.step, f32::NAN, self.log.last());
        }
        Ok(Outcome {
            start: self.start,
            table: self.training.visits().inherit(&self.learner.table()),
            best: self.best.map(|(step, _, table)| (step, table)),
            steps: self.step,
            skipped: self.skipped,
            log: self.log,
            stopped,
        })
    }

    /// Appends an entry to the log, and stores the table if its validation loss is the lowest so far.
    fn validate(&mut self) {
        if self.log.last().is_some_and(|e| e.step == self.step) {
            return;
        }
        let table = self.learner.table();
        let filled = self.training.visits().inherit(&table);
        let crops = self.training.losses(&table);
        let validation_crops = self.validation.losses(&filled);
        let score = mean_loss(&validation_crops, self.beta);
        // A loss that is not finite is never the best, and could not be read back from a checkpoint.
        if let Some(score) = score.filter(|s| s.is_finite())
            && self.best.as_ref().is_none_or(|best| score < best.1)
        {
            self.best = Some((self.step, score, filled));
        }
        self.log.push(LogEntry {
            step: self.step,
            loss: mean_loss(&crops, self.beta).unwrap_or(f32::NAN),
            validation: score,
            crops,
            validation_crops,
            seconds: Some(self.clock.elapsed().as_secs_f64()),
        });
    }

    /// Writes the checkpoint, if there is a folder.
    fn save(&self) -> Result<(), TrainError> {
        let Some(path) = &self.path else {
            return Ok(());
        };
        let checkpoint = Checkpoint {
            fingerprint: self.fingerprint.clone(),
            step: self.step,
            best: self.best.clone(),
            anchor: self
                .training
                .anchor
                .as_ref()
                .unwrap_or(&self.anchor)
                .clone(),
            state: self
                .learner
                .to_bytes()
                .map_err(|e| TrainError::State(e.to_string()))?,
        };
        Ok(checkpoint.save(path)?)
    }
}
