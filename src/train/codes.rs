//! The roughness lists of paths, each kept once.
//!
//! α′ and its derivative depend on the list of roughness values alone, of which a scene has some thousands: they are
//! computed per list ("code"), not per event.

use crate::regularise::{
    AttenuationTable, Dependence, GammaIndex, MAX_VERTICES, PathRoughness, accumulate_with_gradient,
};
use rayon::prelude::*;
use std::collections::HashMap;

/// Interned lists of own roughness, camera first, last vertex last.
#[derive(Clone, Debug, Default)]
pub struct Codes {
    lists: Vec<Box<[f32]>>,
    index: HashMap<Box<[u32]>, u32>,
}

/// α′ of a code and what it depends on.
#[derive(Clone, Debug, Default)]
pub struct Roughness {
    /// Accumulated roughness.
    pub alpha: f32,
    /// dα′/dγ of each table entry it depends on.
    pub gradient: Dependence,
}

impl Roughness {
    fn new(list: &[f32], table: &AttenuationTable) -> Self {
        let (alpha, gradient) = accumulate_with_gradient(list, table);
        Self { alpha, gradient }
    }
}

fn is_long(list: &[f32]) -> bool {
    list.len() > MAX_VERTICES
}

impl Codes {
    /// The code of a list.
    pub fn intern(&mut self, list: &[f32]) -> u32 {
        let key: Box<[u32]> = list.iter().map(|a| a.to_bits()).collect();
        let next = self.lists.len() as u32;
        *self.index.entry(key).or_insert_with(|| {
            self.lists.push(list.into());
            next
        })
    }

    /// Takes over another set; the codes that its lists have here, in its order.
    pub fn absorb(&mut self, other: &Self) -> Vec<u32> {
        other.lists.iter().map(|list| self.intern(list)).collect()
    }

    /// Number of codes.
    pub fn len(&self) -> usize {
        self.lists.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }

    /// The list of a code.
    pub fn list(&self, code: u32) -> &[f32] {
        &self.lists[code as usize]
    }

    /// α′ and derivative of every code.
    pub fn roughness(&self, table: &AttenuationTable) -> Vec<Roughness> {
        (self.lists.par_iter())
            .map(|list| Roughness::new(list, table))
            .collect()
    }

    /// α′ and derivative of the codes of paths that fold; of the others, zeros.
    pub fn long_roughness(&self, table: &AttenuationTable) -> Vec<Roughness> {
        (self.lists.par_iter())
            .map(|list| match is_long(list) {
                true => Roughness::new(list, table),
                false => Roughness::default(),
            })
            .collect()
    }

    /// α′ of the codes of paths that fold; of the others, zeros.
    pub fn long_alphas(&self, table: &AttenuationTable) -> Vec<f32> {
        (self.lists.par_iter())
            .map(|list| match list.split_last() {
                Some((&last, before)) if is_long(list) => {
                    PathRoughness::of(before, table).accumulate(last, table, 1.0)
                }
                _ => 0.0,
            })
            .collect()
    }

    /// Whether a path folds: α′ then depends on the factors of more than one class.
    pub fn is_long(&self, code: u32) -> bool {
        is_long(self.list(code))
    }

    /// The table entries and weights that make the factor of a code that does not fold.
    pub fn entries(&self, code: u32, table: &AttenuationTable) -> Vec<(GammaIndex, f32)> {
        let Some((&last, before)) = self.list(code).split_last() else {
            return Vec::new();
        };
        let prefix = PathRoughness::of(before, table);
        let mut entries = Vec::new();
        if !before.is_empty() {
            table.entries(&prefix, last, |class, weight| entries.push((class, weight)));
        }
        entries
    }

    /// The class of a code, by its own levels; of a long one the class of its last five vertices.
    pub fn class(&self, code: u32) -> Option<GammaIndex> {
        let list = self.list(code);
        let levels: Vec<usize> = list[list.len().saturating_sub(MAX_VERTICES)..]
            .iter()
            .map(|&a| crate::regularise::bin(a))
            .collect();
        GammaIndex::from_levels(&levels)
    }
}
