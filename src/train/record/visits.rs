//! How often each class was seen, and what a class that never was inherits.

use crate::regularise::{AttenuationTable, GammaIndex, LEN};
use crate::train::record::recording::Recording;

/// Events per class.
#[derive(Clone, Debug, PartialEq)]
pub struct Visits(pub Vec<u64>);

impl Default for Visits {
    fn default() -> Self {
        Self(vec![0; LEN])
    }
}

impl Visits {
    /// Counts the events of a recording at every class whose factor they depend on.
    pub fn count(&mut self, recording: &Recording, table: &AttenuationTable) {
        let roughness = recording.codes.roughness(table);
        for event in &recording.events {
            for (class, _) in roughness.at(event.code).1 {
                self.0[class.index()] += 1;
            }
        }
    }

    /// Gives every class that was never visited the factor of its longest visited suffix: the class without the
    /// vertices nearest the camera. Without one it gets the median of the visited factors.
    pub fn inherit(&self, table: &AttenuationTable) -> AttenuationTable {
        let mut visited: Vec<f32> = (table.gammas.iter().zip(&self.0))
            .filter(|(_, visits)| **visits > 0)
            .map(|(gamma, _)| *gamma)
            .collect();
        visited.sort_by(f32::total_cmp);
        let median = visited.get(visited.len() / 2).copied();
        let mut whole = table.clone();
        for class in (0..LEN).filter_map(GammaIndex::new) {
            if self.0[class.index()] > 0 {
                continue;
            }
            let mut suffix = class.suffix();
            while let Some(s) = suffix
                && self.0[s.index()] == 0
            {
                suffix = s.suffix();
            }
            let gamma = suffix.map(|s| table.gammas[s.index()]).or(median);
            if let Some(gamma) = gamma {
                whole.gammas[class.index()] = gamma;
            }
        }
        whole
    }

    /// Visited classes among the [`LIVE`] ones whose last vertex is not on the top level.
    pub fn coverage(&self) -> usize {
        (0..LEN)
            .filter_map(GammaIndex::new)
            .filter(|&c| is_live(c) && self.0[c.index()] > 0)
            .count()
    }
}

/// Classes whose last vertex is not on the top level, where there is hardly anything to roughen.
pub const LIVE: usize = LEN / 4 * 3;

/// Whether a class is one of the [`LIVE`].
pub fn is_live(class: GammaIndex) -> bool {
    class
        .bins()
        .last()
        .is_some_and(|&level| level + 1 < crate::regularise::BINS)
}
