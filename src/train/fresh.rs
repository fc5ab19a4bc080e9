//! Fresh: paths are traced anew at every step with the table of that step. Slow, and what the other ways are checked
//! against.

use super::dataset::Crop;
use super::moments::{Adjoint, Moments, Source, no_gradient};
use super::replay::Replay;
use crate::regularise::{Accumulated, AttenuationTable};

/// Traces a crop whenever its moments are asked for.
pub struct Fresh {
    crop: Crop,
    spp: u32,
    seed: u64,
    traced: u64,
    last: Option<Replay>,
}

impl Fresh {
    /// Of a crop; every tracing has a seed of its own that follows from `seed`.
    pub fn new(crop: Crop, spp: u32, seed: u64) -> Self {
        Self {
            crop,
            spp,
            seed,
            traced: 0,
            last: None,
        }
    }
}

impl Source for Fresh {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        let rule = Accumulated {
            attenuation: table,
            lambda: 0.0,
        };
        // Far from the seeds next to it, which other replicates use.
        let seed = self.seed ^ self.traced.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.traced += 1;
        // A crop that was opened has a window inside of its frame.
        let Ok(recording) = self.crop.record_with(rule, self.spp, seed) else {
            return Moments::zero(self.crop.window.len());
        };
        self.last.insert(Replay::new(recording)).moments(table)
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
