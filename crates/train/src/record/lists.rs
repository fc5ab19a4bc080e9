//! Roughness values of paths, each list stored once.
//!
//! α′ and its derivative depend on the list of a path's roughness values alone. There are far fewer lists than events,
//! so both are computed per list and looked up by its number, the *code*. While paths are traced, lists grow vertex by
//! vertex in a tree (`Interner`); a finished recording has them sorted ([`RoughnessLists`]).

use crate::derivative::{Dependence, Differentiated};
use foldhash::fast::FixedState;
use opsr::regularise::{AttenuationTable, GammaIndex, MAX_VERTICES, PathRoughness};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Codes that a thread evaluates at a time.
const CHUNK: usize = 1024;

/// Roughness lists while paths are traced, as a tree: every node is a vertex and stands for the list that leads to it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interner {
    /// Parent and roughness.
    nodes: Vec<(Option<u32>, f32)>,
    /// Node by its [`key`].
    index: HashMap<u64, u32, FixedState>,
}

/// Parent and roughness of a node as one number, which hashes fast: every vertex of every path is looked up.
fn key(parent: Option<u32>, alpha: f32) -> u64 {
    let parent = parent.map_or(0, |p| u64::from(p) + 1);
    parent << 32 | u64::from(alpha.to_bits())
}

impl Interner {
    /// The code of the list that extends `parent` by a vertex of roughness `alpha`.
    pub(crate) fn intern(&mut self, parent: Option<u32>, alpha: f32) -> u32 {
        let next = self.nodes.len() as u32;
        *self.index.entry(key(parent, alpha)).or_insert_with(|| {
            self.nodes.push((parent, alpha));
            next
        })
    }

    /// Number of lists.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The list of a code, camera first.
    pub(crate) fn list(&self, code: u32) -> Vec<f32> {
        let mut list = Vec::new();
        let mut at = Some(code);
        while let Some((parent, alpha)) = at.map(|code| self.nodes[code as usize]) {
            list.push(alpha);
            at = parent;
        }
        list.reverse();
        list
    }

    /// Adds the `used` lists of another tree, and returns the new code of each of its codes.
    pub(crate) fn absorb(&mut self, other: &Self, mut used: Vec<bool>) -> Vec<u32> {
        // Parents come before their children.
        for code in (0..other.len()).rev() {
            if let (Some(parent), _) = other.nodes[code] {
                used[parent as usize] |= used[code];
            }
        }
        let mut place = vec![u32::MAX; other.len()];
        for (code, &(parent, alpha)) in other.nodes.iter().enumerate() {
            if used[code] {
                place[code] = self.intern(parent.map(|p| place[p as usize]), alpha);
            }
        }
        place
    }

    /// The `used` lists, sorted, and the new code of each code.
    pub(crate) fn sorted(&self, used: &[bool]) -> (RoughnessLists, Vec<u32>) {
        let used = (0u32..).zip(used).filter(|(_, used)| **used);
        let mut lists: Vec<(Vec<f32>, u32)> =
            used.map(|(code, _)| (self.list(code), code)).collect();
        lists.par_sort_unstable_by(|(a, _), (b, _)| {
            let (a, b) = (a.iter().map(|a| a.to_bits()), b.iter().map(|b| b.to_bits()));
            a.cmp(b)
        });
        let mut place = vec![u32::MAX; self.len()];
        for (new, (_, old)) in (0u32..).zip(&lists) {
            place[*old as usize] = new;
        }
        let lists = lists.iter().map(|(list, _)| list.as_slice());
        (RoughnessLists::from_sorted(lists), place)
    }
}

/// Distinct lists of roughness values, camera first, last vertex last; sorted, so that lists with a common prefix are
/// neighbours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoughnessLists {
    /// All lists, one after the other.
    values: Vec<f32>,
    /// End of each list in `values`.
    ends: Vec<u32>,
    /// Length of the prefix shared with the previous list.
    shared: Vec<u32>,
}

impl RoughnessLists {
    pub(crate) fn from_sorted<'a>(sorted: impl Iterator<Item = &'a [f32]>) -> Self {
        let mut lists = Self::default();
        let mut previous: &[f32] = &[];
        for list in sorted {
            let shared = previous.iter().zip(list).take_while(|(a, b)| a == b);
            lists.shared.push(shared.count() as u32);
            lists.values.extend(list);
            lists.ends.push(lists.values.len() as u32);
            previous = list;
        }
        lists
    }

    /// Number of lists.
    pub(crate) fn len(&self) -> usize {
        self.ends.len()
    }

    /// All codes, in order.
    pub(crate) fn codes(&self) -> Range<u32> {
        0..self.len() as u32
    }

    /// The list of a code, camera first.
    pub fn list(&self, code: u32) -> &[f32] {
        let code = code as usize;
        let start = code.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.values[start as usize..self.ends[code] as usize]
    }

    /// True if a path folds: α′ then depends on the factors of more than one class.
    pub(crate) fn is_long(&self, code: u32) -> bool {
        self.list(code).len() > MAX_VERTICES
    }

    /// The lists of paths that fold, and the code of each in `self`.
    pub(crate) fn long(&self) -> (Self, Vec<u32>) {
        let long: Vec<u32> = self.codes().filter(|&code| self.is_long(code)).collect();
        let lists = long.iter().map(|&code| self.list(code));
        (Self::from_sorted(lists), long)
    }

    /// The table entries and weights that make the factor of a path that does not fold.
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

    /// α′ of every list.
    pub fn alphas(&self, table: &AttenuationTable) -> Vec<f32> {
        let chunks = self.walk(
            || Vec::with_capacity(CHUNK),
            |path: &mut PathRoughness, alpha| path.push(alpha, table, 1.0),
            |chunk: &mut Vec<f32>, path, last| chunk.push(path.accumulate(last, table, 1.0)),
        );
        chunks.concat()
    }

    /// α′ of every list and its derivatives by the factors of `table`.
    pub(crate) fn alphas_with_gradient(&self, table: &AttenuationTable) -> ListAlphas {
        let chunks = self.walk(
            AlphaChunk::with_room,
            |path: &mut Differentiated, alpha| path.push(alpha, table),
            |chunk: &mut AlphaChunk, path, last| chunk.push(path, last, table),
        );
        ListAlphas { chunks }
    }

    /// Walks all lists, chunk by chunk in parallel. `push` adds a vertex to a path state `S`, once for all lists with
    /// the same prefix. `visit` gets the chunk's result, the state before the last vertex, and that vertex's roughness.
    fn walk<S: Clone + Default, T: Send>(
        &self,
        result: impl Fn() -> T + Sync,
        push: impl Fn(&mut S, f32) + Sync,
        visit: impl Fn(&mut T, &S, f32) + Sync,
    ) -> Vec<T> {
        let chunks = (0..self.len()).into_par_iter().step_by(CHUNK);
        let walk_chunk = |start: usize| {
            let mut result = result();
            // States after 0, 1, 2 … vertices of the current list; entries beyond its end belong to earlier lists.
            let mut states = vec![S::default()];
            let mut known = 0;
            for code in start..self.len().min(start + CHUNK) {
                let (&last, before) = self.list(code as u32).split_last().unwrap_or((&1.0, &[]));
                known = known.min(self.shared[code] as usize).min(before.len());
                for (i, &alpha) in before.iter().enumerate().skip(known) {
                    if states.len() < i + 2 {
                        states.push(S::default());
                    }
                    let (done, next) = states.split_at_mut(i + 1);
                    next[0].clone_from(&done[i]);
                    push(&mut next[0], alpha);
                }
                known = before.len();
                visit(&mut result, &states[known], last);
            }
            result
        };
        chunks.map(walk_chunk).collect()
    }
}

/// α′ of every list and its derivatives by the table's factors.
#[derive(Clone, Debug, Default)]
pub struct ListAlphas {
    /// [`CHUNK`] lists each.
    chunks: Vec<AlphaChunk>,
}

/// Number of derivatives stored beside α′: enough for paths of up to nine vertices whose factors are not interpolated.
const INLINE: usize = 2;

/// α′ of a list and its derivatives, in one struct because lists are read in random order.
#[derive(Clone, Copy, Debug, Default)]
struct ListAlpha {
    alpha: f32,
    /// Number of derivatives; more than [`INLINE`] of them are in the chunk, from `start` on.
    count: u32,
    start: u32,
    inline: [(GammaIndex, f32); INLINE],
}

/// α′ of some lists, and the derivatives of those that have many.
#[derive(Clone, Debug, Default)]
struct AlphaChunk {
    alphas: Vec<ListAlpha>,
    derivatives: Dependence,
    /// Derivatives of the current list.
    scratch: Dependence,
}

impl AlphaChunk {
    fn with_room() -> Self {
        Self {
            alphas: Vec::with_capacity(CHUNK),
            ..Self::default()
        }
    }

    fn push(&mut self, path: &Differentiated, last: f32, table: &AttenuationTable) {
        self.scratch.clear();
        let mut entry = ListAlpha {
            alpha: path.accumulate(last, table, &mut self.scratch),
            count: self.scratch.len() as u32,
            start: self.derivatives.len() as u32,
            ..ListAlpha::default()
        };
        match entry.inline.get_mut(..self.scratch.len()) {
            Some(inline) => inline.copy_from_slice(&self.scratch),
            None => self.derivatives.extend(&self.scratch),
        }
        self.alphas.push(entry);
    }
}

/// α′ of some lists in the order in which they are needed.
#[derive(Debug, Default)]
pub(crate) struct PrefetchBuffer {
    entries: Vec<(ListAlpha, u32)>,
}

impl ListAlphas {
    /// Copies α′ of `codes` into a buffer, in a loop that does nothing else. The processor then waits for many cache
    /// misses at a time instead of one after the other.
    pub(crate) fn prefetch(&self, codes: impl Iterator<Item = u32>, buffer: &mut PrefetchBuffer) {
        buffer.entries.clear();
        buffer
            .entries
            .extend(codes.map(|code| (*self.entry(code), code)));
    }

    /// α′ and derivatives of the lists in a buffer.
    pub(crate) fn prefetched<'a>(
        &'a self,
        buffer: &'a PrefetchBuffer,
    ) -> impl Iterator<Item = (f32, &'a [(GammaIndex, f32)])> {
        let entries = buffer.entries.iter();
        entries.map(|(entry, code)| (entry.alpha, self.derivatives(entry, *code)))
    }

    /// α′ of a list, and its derivatives by the table entries on which it depends.
    #[inline]
    pub fn at(&self, code: u32) -> (f32, &[(GammaIndex, f32)]) {
        let entry = self.entry(code);
        (entry.alpha, self.derivatives(entry, code))
    }

    fn entry(&self, code: u32) -> &ListAlpha {
        &self.chunks[code as usize / CHUNK].alphas[code as usize % CHUNK]
    }

    #[inline]
    fn derivatives<'a>(&'a self, entry: &'a ListAlpha, code: u32) -> &'a [(GammaIndex, f32)] {
        let count = entry.count as usize;
        entry.inline.get(..count).unwrap_or_else(|| {
            let chunk = &self.chunks[code as usize / CHUNK];
            &chunk.derivatives[entry.start as usize..][..count]
        })
    }
}

#[cfg(test)]
mod tests;
