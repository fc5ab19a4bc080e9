//! A session: scenes are opened and recorded once, then a table is learned for every β.

use crate::files::hex;
use crate::gallery::manifest::Role;
use crate::regularise::file::Provenance;
use crate::sampler::{Domain, Seed};
use crate::train::config::{Config, Evaluation, Loss, Optimiser};
use crate::train::evaluate::MomentSource;
use crate::train::evaluate::curves::Curves;
use crate::train::evaluate::fresh::Fresh;
use crate::train::evaluate::replay::Replay;
use crate::train::learn::crop_set::CropSet;
use crate::train::learn::outer_loop::{Listener, Outcome, OuterLoop, TrainError};
use crate::train::record::crop::{BRIGHTNESS, Crop, DatasetError, EPSILON};
use crate::train::record::visits::Visits;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// An opened and recorded training.
pub struct Session {
    /// The configuration.
    pub config: Config,
    /// Crops that are learned from.
    pub training: CropSet,
    /// Crops that are only scored.
    pub validation: CropSet,
    /// Wall-clock seconds of recording and baking.
    pub seconds: f64,
}

impl Session {
    /// Opens the scenes of a configuration and records them. `listen` gets the name of each crop when its recording
    /// begins.
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
        let training = training.into_iter().map(|crop| (crop, true));
        let validation = validation.into_iter().map(|crop| (crop, false));
        let jobs: Vec<RecordingJob> = training
            .chain(validation)
            .flat_map(|(crop, training)| RecordingJob::replicates(crop, training, &config))
            .collect();
        let mut session = Self {
            training: CropSet::default(),
            validation: CropSet::default(),
            seconds: 0.0,
            config,
        };
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

    /// Learns a table for one β.
    ///
    /// The state is kept in `last.ckpt` of `folder`, from which `resume` continues bit-identically. The listener hears
    /// of every step and can stop the training.
    pub fn learn(
        &mut self,
        beta: f32,
        folder: Option<&Path>,
        resume: bool,
        listen: Listener<'_>,
    ) -> Result<Outcome, TrainError> {
        let (training, validation) = (&mut self.training, &mut self.validation);
        let mut outer = OuterLoop::new(&self.config, training, validation, beta, folder)?;
        if resume {
            outer = outer.resume()?;
        }
        outer.run(listen)
    }

    /// Provenance of a table after `steps` steps, for its file.
    pub fn provenance(&self, beta: f32, start: f32, steps: u32) -> Provenance {
        let config = &self.config;
        let mut scenes: Vec<(String, String)> = Vec::new();
        for crop in self.training.crops() {
            let hash = hex(&crop.digest);
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
                EPSILON, BRIGHTNESS
            ),
            beta: f64::from(beta),
            spp: config.spp,
            model: format!("{:?}", config.model).to_lowercase(),
            optimiser: format!(
                "{}, rate {}, beta1 0.9, beta2 0.999, epsilon 1e-8, factors kept in [0.001, 1]",
                match config.optimiser {
                    Optimiser::Adam => "Adam",
                    Optimiser::Log => "Adam on ln gamma",
                },
                config.step_size()
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

/// Moments of a recorded crop, and the events per class of its recording.
type Recorded = Result<(Box<dyn MomentSource>, Visits), DatasetError>;

/// A crop to record.
struct RecordingJob {
    crop: Crop,
    /// True if the crop is learned from.
    training: bool,
    seed: Seed,
    spp: u32,
}

impl RecordingJob {
    /// The recordings of a crop: `replicates` of a training crop, one of a validation crop.
    fn replicates(crop: Crop, training: bool, config: &Config) -> Vec<Self> {
        // The noise-free loss has one image of all samples.
        let (replicates, spp) = match config.loss {
            Loss::Published => (config.replicates, config.spp),
            Loss::NoiseFree => (1, config.spp.saturating_mul(config.replicates)),
        };
        let replicates = 0..if training { replicates } else { 1 };
        let domain = if training {
            Domain::Recording
        } else {
            Domain::Validation
        };
        let job = |replicate| Self {
            crop: crop.clone(),
            training,
            seed: Seed(config.seed).derive(domain, u64::from(replicate)),
            spp,
        };
        replicates.map(job).collect()
    }

    /// Traces the crop and prepares the configured evaluation.
    fn run(&self, config: &Config) -> Recorded {
        let Self {
            crop, seed, spp, ..
        } = self;
        let gammas = &config.record_gammas;
        let middle = config.constant(gammas[gammas.len() / 2]);
        let mut visits = Visits::default();
        if config.method == Evaluation::Fresh && self.training {
            // Visits are those of a recording with any evaluation.
            let recording = crop.record(gammas, config.roulette, (*spp).min(64), *seed)?;
            visits.count(&recording, &middle);
            return Ok((Box::new(Fresh::new(crop.clone(), *spp, *seed)), visits));
        }
        let recording = crop.record(gammas, config.roulette, *spp, *seed)?;
        visits.count(&recording, &middle);
        let source: Box<dyn MomentSource> = match config.method {
            Evaluation::Replay => Box::new(Replay::new(recording)),
            Evaluation::Fresh | Evaluation::Tabulated => {
                Box::new(Curves::bake(&recording, &middle))
            }
        };
        Ok((source, visits))
    }
}

/// Runs jobs, two at a time: while one thread puts a recording together, the paths of another are traced. Results are
/// in the order of the jobs, up to the first error.
fn run_all(
    jobs: &[RecordingJob],
    config: &Config,
    listen: &(dyn Fn(&str) + Sync),
) -> Vec<Recorded> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else {
                return done;
            };
            listen(&job.crop.name);
            let result = job.run(config);
            if result.is_err() {
                next.store(jobs.len(), Ordering::Relaxed);
            }
            done.push((index, result));
        }
    };
    let (mut done, others) = rayon::join(worker, worker);
    done.extend(others);
    done.sort_unstable_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}
