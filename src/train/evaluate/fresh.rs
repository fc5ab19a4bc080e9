//! Fresh: paths are traced anew at every step with the table of that step. Slow, and what the other ways are checked
//! against.

use crate::regularise::{Accumulated, AttenuationTable};
use crate::sampler::{Domain, Seed};
use crate::train::evaluate::moments::{Adjoint, Moments, Source, no_gradient};
use crate::train::evaluate::replay::Replay;
use crate::train::record::crop::Crop;

/// Traces a crop whenever its moments are asked for.
pub struct Fresh {
    crop: Crop,
    spp: u32,
    seed: Seed,
    traced: u64,
    last: Option<Replay>,
}

impl Fresh {
    /// Of a crop; every tracing has a seed of its own that follows from `seed`.
    pub fn new(crop: Crop, spp: u32, seed: Seed) -> Self {
        Self {
            crop,
            spp,
            seed,
            traced: 0,
            last: None,
        }
    }

    /// Paths that nobody has seen; `None` for a crop outside of its frame, which cannot be opened.
    fn trace(&self, table: &AttenuationTable, number: u64) -> Option<Replay> {
        let rule = Accumulated {
            attenuation: table,
            lambda: 0.0,
        };
        let seed = self.seed.derive(Domain::Retrace, number);
        let recording = self.crop.record_with(rule, self.spp, seed).ok()?;
        Some(Replay::new(recording))
    }
}

impl Source for Fresh {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        self.traced += 1;
        match self.trace(table, self.traced) {
            Some(replay) => self.last.insert(replay).moments(table),
            None => Moments::zero(self.crop.window.len()),
        }
    }

    /// Of the same paths every time.
    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        match self.trace(table, 0) {
            Some(mut replay) => replay.moments(table),
            None => Moments::zero(self.crop.window.len()),
        }
    }

    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        match &self.last {
            Some(replay) => replay.gradient(table, adjoint),
            None => no_gradient(),
        }
    }

    fn skip(&mut self, steps: u64) {
        self.traced = steps;
    }
}
