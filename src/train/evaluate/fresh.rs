//! Fresh: paths are traced anew at every step with the table of that step. It is slow, and the measure of the other
//! sources.

use crate::regularise::{AttenuationTable, Rule};
use crate::sampler::{Domain, Seed};
use crate::train::evaluate::replay::Replay;
use crate::train::evaluate::{Adjoint, MomentSource, Moments, no_gradient};
use crate::train::record::crop::Crop;

/// Traces a crop at every call.
pub struct Fresh {
    crop: Crop,
    spp: u32,
    seed: Seed,
    /// Number of calls of [`MomentSource::moments`].
    traced: u64,
    last: Option<Replay>,
}

impl Fresh {
    /// A crop with `spp` samples per pixel; the seed of every call follows from `seed`.
    pub fn new(crop: Crop, spp: u32, seed: Seed) -> Self {
        Self {
            crop,
            spp,
            seed,
            traced: 0,
            last: None,
        }
    }

    /// Paths of the call with this number; `None` for a crop outside of its frame, which cannot be opened.
    fn trace(&self, table: &AttenuationTable, number: u64) -> Option<Replay> {
        let rule = Rule::with_table(table.clone());
        let seed = self.seed.derive(Domain::Retrace, number);
        let recording = self.crop.record_with(rule, self.spp, seed).ok()?;
        Some(Replay::new(recording))
    }
}

impl MomentSource for Fresh {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        self.traced += 1;
        match self.trace(table, self.traced) {
            Some(replay) => self.last.insert(replay).moments(table),
            None => Moments::zero(self.crop.window.len()),
        }
    }

    /// Always with the paths of call 0.
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

    fn skip(&mut self, times: u64) {
        self.traced = times;
    }
}
