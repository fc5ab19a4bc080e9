//! Events per class, and the factors that unvisited classes inherit.

use crate::record::recording::Recording;
use opsr::regularise::{AttenuationTable, BINS, GammaIndex, LEN};

/// Number of live classes, whose last vertex is below the top bin. Roughening hardly changes lobes of the top bin.
pub const LIVE_CLASSES: usize = LEN / 4 * 3;

/// Events per class.
#[derive(Clone, Debug, PartialEq)]
pub struct Visits(pub Vec<u64>);

impl Default for Visits {
    fn default() -> Self {
        Self(vec![0; LEN])
    }
}

impl Visits {
    /// Counts the events of a recording in every class on whose factor they depend.
    pub fn count(&mut self, recording: &Recording, table: &AttenuationTable) {
        let alphas = recording.lists.alphas_with_gradient(table);
        for event in &recording.events {
            for (class, _) in alphas.at(event.code).1 {
                self.0[class.index()] += 1;
            }
        }
    }

    /// True for a class with events.
    pub(crate) fn has(&self, class: GammaIndex) -> bool {
        self.0[class.index()] > 0
    }

    /// The longest suffix of a class that has events.
    pub(crate) fn suffix(&self, class: GammaIndex) -> Option<GammaIndex> {
        let mut suffix = class.suffix();
        while let Some(s) = suffix
            && !self.has(s)
        {
            suffix = s.suffix();
        }
        suffix
    }

    /// Gives every unvisited class the factor of its longest visited suffix: the class without the vertices nearest the
    /// camera. Without one it gets the median of the visited factors.
    pub(crate) fn inherit(&self, table: &AttenuationTable) -> AttenuationTable {
        let mut visited: Vec<f32> = table
            .gammas
            .iter()
            .zip(&self.0)
            .filter(|(_, visits)| **visits > 0)
            .map(|(gamma, _)| *gamma)
            .collect();
        visited.sort_by(f32::total_cmp);
        let median = visited.get(visited.len() / 2).copied();
        let mut filled = table.clone();
        for class in (0..LEN).filter_map(GammaIndex::new) {
            if self.has(class) {
                continue;
            }
            let gamma = (self.suffix(class)).map(|s| table.gammas[s.index()]);
            let gamma = gamma.or(median);
            if let Some(gamma) = gamma {
                filled.gammas[class.index()] = gamma;
            }
        }
        filled
    }

    /// Number of live classes with at least `n` events.
    pub fn live_with(&self, n: u64) -> usize {
        (0..LEN)
            .filter_map(GammaIndex::new)
            .filter(|&c| is_live(c) && self.0[c.index()] >= n)
            .count()
    }
}

/// True if the last vertex of a class is below the top bin.
pub fn is_live(class: GammaIndex) -> bool {
    class.bins().last().is_some_and(|&bin| bin + 1 < BINS)
}
