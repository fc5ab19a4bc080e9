//! A training: scenes are opened and recorded once, then a table is learned for every β.

use crate::gallery::manifest::Role;
use crate::regularise::AttenuationTable;
use crate::regularise::file::Provenance;
use crate::train::config::{Config, ConfigError, Evaluation, Loss};
use crate::train::learn::checkpoint::{Checkpoint, CheckpointError};
use crate::train::learn::crop_set::{CropSet, mean_loss};
use crate::train::learn::job::{RecordingJob, run_all};
use crate::train::learn::model::Learner;
use crate::train::learn::objective::{CropLoss, LossBackend};
use crate::train::learn::progress::TrainingState;
use crate::train::record::crop::{Crop, DatasetError};
use crate::train::study::best_constant;
use burn::store::RecordError;
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Adam squares the gradient in single precision; a moment of infinity would hold its factor for ever.
const LARGEST: f64 = 1e18;

/// Steps without a usable gradient after which a training gives up.
const MOST_SKIPPED: u32 = 100;

/// Why a training could not go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Scenes and references.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The optimiser's state.
    #[error("optimiser state: {0}")]
    State(#[from] RecordError),
    /// Nothing to learn from.
    #[error("{0}")]
    Empty(String),
    /// Too many steps had to be left out.
    #[error(
        "step {step}: the loss or its gradient was not finite for the {skipped}th time; the checkpoint holds the \
         last good state"
    )]
    NotFinite {
        /// Steps taken.
        step: u32,
        /// Steps left out.
        skipped: u32,
    },
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogEntry {
    /// Steps taken.
    pub step: u32,
    /// The loss over the training crops.
    pub loss: f32,
    /// The loss over the validation crops, unvisited classes inherited.
    pub validation: Option<f32>,
    /// The loss of each training crop.
    pub crops: Vec<CropLoss>,
    /// The loss of each validation crop.
    pub validation_crops: Vec<CropLoss>,
    /// Seconds since the start or the resumption.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
}

/// Hears of every step: its number, its loss, and the log's entry where there is one.
pub type Listener<'a> = &'a mut dyn FnMut(u32, f32, Option<&LogEntry>) -> ControlFlow<()>;

/// What came out for one β.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Where all factors started.
    pub start: f32,
    /// The learned table, unvisited classes inherited.
    pub table: AttenuationTable,
    /// The table with the lowest validation loss, and its step.
    pub best: Option<(u32, AttenuationTable)>,
    /// Steps taken.
    pub steps: u32,
    /// Steps whose loss or gradient was not finite or beyond measure: the table and the optimiser stayed as they were.
    pub skipped: u32,
    /// The log.
    pub log: Vec<LogEntry>,
    /// Whether the listener ended it.
    pub stopped: bool,
}

/// An opened and recorded training.
pub struct Session {
    /// The configuration.
    pub config: Config,
    /// What is learned from.
    pub training: CropSet,
    /// What is only scored.
    pub validation: CropSet,
    /// Wall seconds that recording and baking took.
    pub seconds: f64,
}

impl Session {
    /// Opens the scenes of a configuration and records them. `listen` is told what is being done.
    pub fn open(config: Config, listen: &(dyn Fn(&str) + Sync)) -> Result<Self, TrainError> {
        config.check()?;
        let held_out = |family: &str| family == config.hold_out;
        let chosen = |name: &String| config.scenes.is_empty() || config.scenes.contains(name);
        let crops = Crop::open_all(&config.manifest, |e| {
            e.role == Role::Validation || held_out(&e.family) || chosen(&e.name)
        })?;
        let (training, validation): (Vec<Crop>, Vec<Crop>) =
            (crops.into_iter()).partition(|c| c.role == Role::Train && !held_out(&c.family));
        if let Some(missing) =
            (config.scenes.iter()).find(|name| !training.iter().any(|c| c.scene_name == **name))
        {
            return Err(TrainError::Empty(format!(
                "{}: no training scene `{missing}`",
                config.manifest.display()
            )));
        }
        Self::with_crops(config, training, validation, listen)
    }

    /// Records these crops.
    pub fn with_crops(
        config: Config,
        training: Vec<Crop>,
        validation: Vec<Crop>,
        listen: &(dyn Fn(&str) + Sync),
    ) -> Result<Self, TrainError> {
        config.check()?;
        if training.is_empty() {
            return Err(TrainError::Empty("no scene to learn from".into()));
        }
        let clock = Instant::now();
        let mut session = Self {
            training: CropSet::default(),
            validation: CropSet::default(),
            seconds: 0.0,
            config,
        };
        let training = training.into_iter().map(|crop| (crop, true));
        let validation = validation.into_iter().map(|crop| (crop, false));
        let jobs: Vec<RecordingJob> = training
            .chain(validation)
            .flat_map(|(crop, training)| RecordingJob::of(crop, training, &session.config))
            .collect();
        for (job, source) in jobs.iter().zip(run_all(&jobs, &session.config, listen)) {
            let (source, visits) = source?;
            let target = job.crop.target(session.config.spp);
            let set = match job.training {
                true => &mut session.training,
                false => &mut session.validation,
            };
            set.push(job.crop.clone(), source, target, visits);
        }
        session.seconds = clock.elapsed().as_secs_f64();
        Ok(session)
    }

    /// A table of one factor with the configuration's look-up.
    pub fn constant(&self, gamma: f32) -> AttenuationTable {
        self.config.constant(gamma)
    }

    /// Where factors start.
    fn start(&mut self, beta: f32) -> f32 {
        if self.config.start > 0.0 {
            self.config.start
        } else {
            best_constant(&mut self.training, beta, self.config.lookup)
        }
    }

    /// Learns a table for one β.
    ///
    /// With a `folder` the state is kept there: `last.ckpt`, from which `resume` goes on to the bit. The listener
    /// hears of every step, with the log's entry where there is one, and can end the training.
    pub fn learn(
        &mut self,
        beta: f32,
        folder: Option<&Path>,
        resume: bool,
        listen: Listener<'_>,
    ) -> Result<Outcome, TrainError> {
        let config = self.config.clone();
        let backend = match config.method {
            Evaluation::Tabulated => LossBackend::Scalar,
            Evaluation::Fresh | Evaluation::Replay => LossBackend::Autodiff,
        };
        let objective = self.training.objective(beta, backend);
        let start = self.start(beta);
        let learner = Learner::new(
            config.model,
            config.optimiser,
            config.rate(),
            config.lookup,
            start,
        );
        let fingerprint = Checkpoint::fingerprint(&config, beta, self.training.crops())?;
        let mut state = TrainingState::new(learner);
        let path = folder.map(|f| f.join("last.ckpt"));
        let mut anchor = self.constant(start);
        if resume && let Some(path) = &path {
            let checkpoint = Checkpoint::load(path, &fingerprint)?;
            anchor.gammas.clone_from(&checkpoint.anchor.gammas);
            state = state.resume(checkpoint, config.lookup, path)?;
        }
        self.training.skip(u64::from(state.step));
        self.training.anchor(anchor);
        let clock = Instant::now();
        let mut stopped = false;
        while state.step < config.steps && !stopped && !state.is_over(config.patience) {
            let table = state.learner.table();
            let (loss, gradient) = self.training.gradient(&objective, &table);
            let due = state.step.is_multiple_of(config.validate_every);
            let before = due.then(|| (state.best.clone(), state.looks));
            if due {
                self.log(&mut state, beta, &clock);
            }
            stopped = listen(state.step, loss, state.log.last().filter(|_| due)).is_break();
            if stopped {
                // A training that goes on looks at this step itself: counted twice, a look would end it too early.
                (state.best, state.looks) = before.unwrap_or((state.best, state.looks));
                break;
            }
            if loss.is_finite() && gradient.iter().all(|g| g.abs() < LARGEST) {
                state.learner.step(&gradient);
            } else {
                state.skipped += 1;
            }
            state.step += 1;
            if state.skipped >= MOST_SKIPPED {
                if let Some(path) = &path {
                    (state.checkpoint(&fingerprint, &self.training)?).save(path)?;
                }
                let TrainingState { step, skipped, .. } = state;
                return Err(TrainError::NotFinite { step, skipped });
            }
            if let Some(path) = &path
                && state.step.is_multiple_of(config.checkpoint_every)
            {
                (state.checkpoint(&fingerprint, &self.training)?).save(path)?;
            }
        }
        // Before the last look, which may move the anchor: a training that goes on does not have it.
        if let Some(path) = &path {
            (state.checkpoint(&fingerprint, &self.training)?).save(path)?;
        }
        if !stopped {
            self.log(&mut state, beta, &clock);
            // Nobody is left to be stopped.
            let _ = listen(state.step, f32::NAN, state.log.last());
        }
        Ok(Outcome {
            start,
            table: self.training.visits().inherit(&state.learner.table()),
            best: state.best.map(|(step, _, table)| (step, table)),
            steps: state.step,
            skipped: state.skipped,
            log: state.log,
            stopped,
        })
    }

    /// Appends to the log, and remembers the table if no other has a lower validation loss.
    fn log(&mut self, state: &mut TrainingState, beta: f32, clock: &Instant) {
        if state.log.last().is_some_and(|e| e.step == state.step) {
            return;
        }
        let table = state.learner.table();
        let whole = self.training.visits().inherit(&table);
        let crops = if self.config.method == Evaluation::Fresh {
            Vec::new()
        } else {
            self.training.losses(&table)
        };
        let validation_crops = self.validation.losses(&whole);
        let score = mean_loss(&validation_crops, beta);
        // A loss that is no number is not a best one, and could not be read back from a checkpoint.
        if let Some(score) = score.filter(|s| s.is_finite())
            && state.best.as_ref().is_none_or(|best| score < best.1)
        {
            state.best = Some((state.step, score, whole));
            state.looks = 0;
        } else {
            state.looks += 1;
        }
        state.log.push(LogEntry {
            step: state.step,
            loss: mean_loss(&crops, beta).unwrap_or(f32::NAN),
            validation: score,
            crops,
            validation_crops,
            seconds: Some(clock.elapsed().as_secs_f64()),
        });
    }

    /// What the table's file says about its making.
    pub fn provenance(&self, beta: f32, start: f32, steps: u32) -> Provenance {
        let config = &self.config;
        let mut scenes: Vec<(String, String)> = Vec::new();
        for crop in self.training.crops() {
            let hash = crate::files::hex(&crop.digest);
            let scene = (crop.scene_name.clone(), hash);
            if !scenes.contains(&scene) {
                scenes.push(scene);
            }
        }
        let kind = match config.loss {
            Loss::Published => "of the realised mean I of N samples",
            Loss::NoiseFree => "of the mean I of all recorded samples",
        };
        Provenance {
            opsr: env!("CARGO_PKG_VERSION").into(),
            loss: format!(
                "mean |I - f| / (f + {}) {kind} + beta mean N/(N-1) (M2 - M1^2), the sample variance of one path \
                 sample; every crop scaled so that its reference has mean {}",
                crate::train::learn::objective::EPSILON,
                crate::train::learn::objective::BRIGHTNESS
            ),
            beta: f64::from(beta),
            spp: config.spp,
            model: format!("{:?}", config.model).to_lowercase(),
            optimiser: format!(
                "{}, rate {}, beta1 0.9, beta2 0.999, epsilon 1e-8, factors kept in [0.001, 1]",
                match config.optimiser {
                    crate::train::learn::model::Optimiser::Adam => "Adam",
                    crate::train::learn::model::Optimiser::Log => "Adam on ln gamma",
                },
                config.rate()
            ),
            method: format!(
                "{:?}, {} recording(s) drawn at gamma {:?}, roulette below {} of the reference",
                config.method, config.replicates, config.record_gammas, config.roulette
            )
            .to_lowercase(),
            steps,
            seed: config.seed,
            scenes,
            start,
            visits: self.training.visits().0,
        }
    }
}
