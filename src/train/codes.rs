//! The roughness lists of paths, each kept once.
//!
//! α′ and its derivative depend on the list of roughness values alone, of which a scene has some thousands: they are
//! computed per list ("code"), not per event.

use crate::regularise::{
    AttenuationTable, Dependence, GammaIndex, MAX_VERTICES, PathRoughness, accumulate_with_gradient,
};
use rayon::prelude::*;
use std::collections::HashMap;

/// Codes that one thread takes at a time.
const CHUNK: usize = 1024;

/// Interned lists of own roughness, camera first, last vertex last.
#[derive(Clone, Debug, Default)]
pub struct Codes {
    /// All lists, one after the other, and where each ends.
    values: Vec<f32>,
    ends: Vec<u32>,
    index: HashMap<Box<[u32]>, u32>,
}

/// α′ of all codes and what it depends on.
#[derive(Clone, Debug, Default)]
pub struct Roughness {
    alphas: Vec<f32>,
    /// The dependences of all codes, one after the other, and where each ends.
    entries: Dependence,
    ends: Vec<u32>,
}

impl Roughness {
    /// Accumulated roughness of a code, and its derivatives by the table entries it depends on.
    #[inline]
    pub fn at(&self, code: u32) -> (f32, &[(GammaIndex, f32)]) {
        let code = code as usize;
        (self.alphas[code], &self.entries[range(&self.ends, code)])
    }

    /// Accumulated roughness of all codes.
    pub fn alphas(&self) -> &[f32] {
        &self.alphas
    }

    fn append(mut self, other: Self) -> Self {
        let offset = self.entries.len() as u32;
        self.alphas.extend(other.alphas);
        self.entries.extend(other.entries);
        self.ends.extend(other.ends.iter().map(|end| end + offset));
        self
    }
}

/// Where the elements of a code are among those of all codes.
fn range(ends: &[u32], code: usize) -> std::ops::Range<usize> {
    let start = code.checked_sub(1).map_or(0, |before| ends[before]);
    start as usize..ends[code] as usize
}

fn is_long(list: &[f32]) -> bool {
    list.len() > MAX_VERTICES
}

impl Codes {
    /// The code of a list.
    pub fn intern(&mut self, list: &[f32]) -> u32 {
        let key: Box<[u32]> = list.iter().map(|a| a.to_bits()).collect();
        let next = self.ends.len() as u32;
        *self.index.entry(key).or_insert_with(|| {
            self.values.extend(list);
            self.ends.push(self.values.len() as u32);
            next
        })
    }

    /// Takes over another set; the codes that its lists have here, in its order.
    pub fn absorb(&mut self, other: &Self) -> Vec<u32> {
        other.lists().map(|list| self.intern(list)).collect()
    }

    fn lists(&self) -> impl Iterator<Item = &[f32]> {
        (0..self.len() as u32).map(|code| self.list(code))
    }

    /// Number of codes.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The list of a code.
    pub fn list(&self, code: u32) -> &[f32] {
        &self.values[range(&self.ends, code as usize)]
    }

    /// α′ and derivative of every code.
    pub fn roughness(&self, table: &AttenuationTable) -> Roughness {
        self.roughness_of(table, |_| true)
    }

    /// α′ and derivative of the codes of paths that fold; of the others, zeros.
    pub fn long_roughness(&self, table: &AttenuationTable) -> Roughness {
        self.roughness_of(table, is_long)
    }

    fn roughness_of(
        &self,
        table: &AttenuationTable,
        wanted: impl Fn(&[f32]) -> bool + Sync,
    ) -> Roughness {
        let codes: Vec<u32> = (0..self.len() as u32).collect();
        let parts: Vec<Roughness> = (codes.par_chunks(CHUNK))
            .map(|codes| {
                let mut part = Roughness::default();
                for &code in codes {
                    let list = self.list(code);
                    let (alpha, gradient) = match wanted(list) {
                        true => accumulate_with_gradient(list, table),
                        false => Default::default(),
                    };
                    part.alphas.push(alpha);
                    part.entries.extend(gradient);
                    part.ends.push(part.entries.len() as u32);
                }
                part
            })
            .collect();
        parts
            .into_iter()
            .fold(Roughness::default(), Roughness::append)
    }

    /// α′ of the codes of paths that fold; of the others, zeros.
    pub fn long_alphas(&self, table: &AttenuationTable) -> Vec<f32> {
        (0..self.len() as u32)
            .into_par_iter()
            .map(|code| match self.list(code).split_last() {
                Some((&last, before)) if self.is_long(code) => {
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
