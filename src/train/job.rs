//! The recordings that a training starts with.

use super::config::{Config, Loss, Way};
use super::curves::Curves;
use super::dataset::{Crop, DatasetError};
use super::fresh::Fresh;
use super::moments::Source;
use super::replay::Replay;
use super::visits::Visits;

/// A recording to be made.
pub(super) struct Job {
    pub(super) crop: Crop,
    /// Whether the crop is learned from.
    pub(super) training: bool,
    seed: u64,
    spp: u32,
}

impl Job {
    /// The recordings that are made of a crop.
    pub(super) fn of(crop: Crop, training: bool, config: &Config) -> Vec<Self> {
        // Without noise in the loss all samples make one picture.
        let (replicates, spp) = match config.loss {
            Loss::Published => (config.replicates, config.spp),
            Loss::NoiseFree => (1, config.spp.saturating_mul(config.replicates)),
        };
        let replicates = 0..if training { replicates } else { 1 };
        let job = |replicate| {
            let seed = config.seed.wrapping_add(u64::from(replicate) << 32);
            Self {
                crop: crop.clone(),
                training,
                seed: if training { seed } else { !seed },
                spp,
            }
        };
        replicates.map(job).collect()
    }

    /// Traces it, and makes of it what the configuration evaluates.
    pub(super) fn run(&self, config: &Config) -> Result<(Box<dyn Source>, Visits), DatasetError> {
        let Self {
            crop, seed, spp, ..
        } = self;
        let gammas = &config.record_gammas;
        let middle = config.constant(gammas[gammas.len() / 2]);
        let mut visits = Visits::default();
        if config.method == Way::Fresh && self.training {
            // Visits are those of a recording whatever the way.
            let recording = crop.record(gammas, config.roulette, (*spp).min(64), config.seed)?;
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
