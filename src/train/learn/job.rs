//! The recordings that a training starts with.

use crate::sampler::{Domain, Seed};
use crate::train::config::{Config, Loss, Way};
use crate::train::evaluate::curves::Curves;
use crate::train::evaluate::fresh::Fresh;
use crate::train::evaluate::moments::Source;
use crate::train::evaluate::replay::Replay;
use crate::train::record::crop::{Crop, DatasetError};
use crate::train::record::visits::Visits;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a job makes.
type Made = Result<(Box<dyn Source>, Visits), DatasetError>;

/// Runs jobs, two at a time: while one thread puts a recording together, the paths of another are traced. Tells which
/// crop begins. What they made is in their order, up to an error.
pub(in crate::train) fn run_all(
    jobs: &[Job],
    config: &Config,
    listen: &(dyn Fn(&str) + Sync),
) -> Vec<Made> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut made = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else {
                return made;
            };
            listen(&job.crop.name);
            let result = job.run(config);
            if result.is_err() {
                next.store(jobs.len(), Ordering::Relaxed);
            }
            made.push((index, result));
        }
    };
    let (mut made, others) = rayon::join(worker, worker);
    made.extend(others);
    made.sort_unstable_by_key(|(index, _)| *index);
    made.into_iter().map(|(_, result)| result).collect()
}

/// A recording to be made.
pub(in crate::train) struct Job {
    pub(in crate::train) crop: Crop,
    /// Whether the crop is learned from.
    pub(in crate::train) training: bool,
    seed: Seed,
    spp: u32,
}

impl Job {
    /// The recordings that are made of a crop.
    pub(in crate::train) fn of(crop: Crop, training: bool, config: &Config) -> Vec<Self> {
        // Without noise in the loss all samples make one picture.
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
        let job = |replicate: u32| Self {
            crop: crop.clone(),
            training,
            seed: Seed(config.seed).derive(domain, replicate.into()),
            spp,
        };
        replicates.map(job).collect()
    }

    /// Traces it, and makes of it what the configuration evaluates.
    fn run(&self, config: &Config) -> Made {
        let Self {
            crop, seed, spp, ..
        } = self;
        let gammas = &config.record_gammas;
        let middle = config.constant(gammas[gammas.len() / 2]);
        let mut visits = Visits::default();
        if config.method == Way::Fresh && self.training {
            // Visits are those of a recording whatever the way.
            let recording = crop.record(gammas, config.roulette, (*spp).min(64), *seed)?;
            visits.count(&recording, &middle);
            return Ok((Box::new(Fresh::new(crop.clone(), *spp, *seed)), visits));
        }
        let recording = crop.record(gammas, config.roulette, *spp, *seed)?;
        visits.count(&recording, &middle);
        let source: Box<dyn Source> = match config.method {
            Way::Replay => Box::new(Replay::new(recording)),
            _ => Box::new(Curves::bake(&recording, &middle)),
        };
        Ok((source, visits))
    }
}
