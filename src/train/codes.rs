//! The roughness lists of paths, each kept once.
//!
//! α′ and its derivative depend on the list of roughness values alone, of which there are far fewer than events: they
//! are computed per list ("code"), not per event.

use crate::regularise::{
    AttenuationTable, Dependence, Differentiated, GammaIndex, MAX_VERTICES, PathRoughness,
};
use foldhash::fast::FixedState;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Codes that one thread takes at a time.
const CHUNK: usize = 1024;

/// Lists of roughness, camera first, last vertex last.
#[derive(Clone, Debug, Default, PartialEq)]
struct Lists {
    /// All lists, one after the other, and where each ends.
    values: Vec<f32>,
    ends: Vec<u32>,
}

impl Lists {
    fn len(&self) -> usize {
        self.ends.len()
    }

    fn list(&self, code: u32) -> &[f32] {
        &self.values[range(&self.ends, code as usize)]
    }

    fn push(&mut self, list: &[f32]) {
        self.values.extend(list);
        self.ends.push(self.values.len() as u32);
    }
}

/// Where the elements of a code are among those of all codes.
fn range(ends: &[u32], code: usize) -> Range<usize> {
    let start = code.checked_sub(1).map_or(0, |before| ends[before]);
    start as usize..ends[code] as usize
}

/// The vertices that paths were traced to, as a tree: each stands for the list that leads to it.
#[derive(Clone, Debug, Default)]
pub(super) struct Interner {
    /// The vertex before, and the own roughness.
    nodes: Vec<(Option<u32>, f32)>,
    /// By what [`key`] makes of a vertex.
    index: HashMap<u64, u32, FixedState>,
}

/// A vertex and the one before it, as one number: it is hashed for every vertex of every path.
fn key(before: Option<u32>, alpha: f32) -> u64 {
    let before = before.map_or(0, |b| u64::from(b) + 1);
    before << 32 | u64::from(alpha.to_bits())
}

impl Interner {
    /// The number of the list that goes on from another with a vertex of this roughness.
    pub(super) fn intern(&mut self, before: Option<u32>, alpha: f32) -> u32 {
        let next = self.nodes.len() as u32;
        *(self.index.entry(key(before, alpha))).or_insert_with(|| {
            self.nodes.push((before, alpha));
            next
        })
    }

    /// How many lists there are.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The list with a number.
    pub(super) fn list(&self, code: u32) -> Vec<f32> {
        let mut list = Vec::new();
        let mut at = Some(code);
        while let Some((before, alpha)) = at.map(|code| self.nodes[code as usize]) {
            list.push(alpha);
            at = before;
        }
        list.reverse();
        list
    }

    /// Takes over those lists of another that are `used`; which number here each of its numbers has become.
    pub(super) fn absorb(&mut self, other: &Self, mut used: Vec<bool>) -> Vec<u32> {
        // What leads to them comes before them.
        for code in (0..other.len()).rev() {
            if let (Some(before), _) = other.nodes[code] {
                used[before as usize] |= used[code];
            }
        }
        let mut place = vec![u32::MAX; other.len()];
        for (code, &(before, alpha)) in other.nodes.iter().enumerate() {
            if used[code] {
                place[code] = self.intern(before.map(|b| place[b as usize]), alpha);
            }
        }
        place
    }

    /// The codes of those lists that are `used`, and which of them each number has become.
    pub(super) fn codes(&self, used: &[bool]) -> (Codes, Vec<u32>) {
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
        (
            Codes::of(lists.iter().map(|(list, _)| list.as_slice())),
            place,
        )
    }
}

/// Distinct lists of own roughness of paths, camera first, last vertex last; such that begin alike are next to one
/// another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Codes {
    lists: Lists,
    /// With how many values of the list before it each begins.
    shared: Vec<u32>,
}

/// α′ of all codes and what it depends on.
#[derive(Clone, Debug, Default)]
pub struct Roughness {
    /// Of [`CHUNK`] codes each.
    parts: Vec<Part>,
}

/// α′ of some codes, and their dependences one after the other.
#[derive(Clone, Debug, Default)]
struct Part {
    /// α′, and where the code's dependences begin.
    codes: Vec<(f32, u32)>,
    entries: Dependence,
}

impl Part {
    /// Of no codes, with room for them and for as many entries as most have.
    fn empty() -> Self {
        Self {
            codes: Vec::with_capacity(CHUNK),
            entries: Vec::with_capacity(4 * CHUNK),
        }
    }

    /// α′ of a code and where its dependences are.
    #[inline]
    fn at(&self, code: usize) -> (f32, Range<usize>) {
        let (alpha, start) = self.codes[code];
        let end = self.codes.get(code + 1).map(|next| next.1 as usize);
        (alpha, start as usize..end.unwrap_or(self.entries.len()))
    }
}

/// α′ of some codes and what it depends on, in the order in which they are needed.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    /// Where the dependences are in the codes' part, and end here.
    places: Vec<(u32, Range<usize>, usize)>,
    alphas: Vec<f32>,
    entries: Dependence,
}

impl Gathered {
    pub(super) fn iter(&self) -> impl Iterator<Item = (f32, &[(GammaIndex, f32)])> {
        let starts = std::iter::once(0).chain(self.places.iter().map(|p| p.2));
        let ranges = starts.zip(&self.places).map(|(start, p)| start..p.2);
        let entries = ranges.map(|range| &self.entries[range]);
        self.alphas.iter().copied().zip(entries)
    }
}

impl Roughness {
    /// Brings what some codes have close together.
    ///
    /// In loops that do nothing else, so that the waits for memory are many at a time and not one after the other.
    pub(super) fn gather(&self, codes: impl Iterator<Item = u32>, to: &mut Gathered) {
        to.places.clear();
        to.alphas.clear();
        to.entries.clear();
        for code in codes {
            let (part, code) = (code / CHUNK as u32, code as usize % CHUNK);
            let (alpha, range) = self.parts[part as usize].at(code);
            to.alphas.push(alpha);
            to.places.push((part, range, 0));
        }
        for (part, range, end) in &mut to.places {
            let entries = &self.parts[*part as usize].entries;
            to.entries.extend_from_slice(&entries[range.clone()]);
            *end = to.entries.len();
        }
    }

    /// Accumulated roughness of a code, and its derivatives by the table entries it depends on.
    #[inline]
    pub fn at(&self, code: u32) -> (f32, &[(GammaIndex, f32)]) {
        let part = &self.parts[code as usize / CHUNK];
        let (alpha, range) = part.at(code as usize % CHUNK);
        (alpha, &part.entries[range])
    }
}

impl Codes {
    fn of<'a>(lists: impl Iterator<Item = &'a [f32]>) -> Self {
        let mut codes = Self::default();
        let mut before: &[f32] = &[];
        for list in lists {
            let alike = before.iter().zip(list).take_while(|(a, b)| a == b);
            codes.shared.push(alike.count() as u32);
            codes.lists.push(list);
            before = list;
        }
        codes
    }

    /// Number of codes.
    pub fn len(&self) -> usize {
        self.lists.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The list of a code.
    pub fn list(&self, code: u32) -> &[f32] {
        self.lists.list(code)
    }

    /// Those of paths that fold, and where they are among all.
    pub fn long(&self) -> (Self, Vec<u32>) {
        let all = 0..self.len() as u32;
        let long: Vec<u32> = all.filter(|&code| self.is_long(code)).collect();
        (Self::of(long.iter().map(|&code| self.list(code))), long)
    }

    /// Follows the vertices before the last of every code with a state that `push` takes along, once for all codes that
    /// begin alike; `visit` gets the state, the last vertex's roughness, and what a thread collects, at first `part`.
    fn follow<S: Clone + Default, T: Send>(
        &self,
        part: impl Fn() -> T + Sync,
        push: impl Fn(&mut S, f32) + Sync,
        visit: impl Fn(&mut T, &S, f32) + Sync,
    ) -> Vec<T> {
        let chunks = (0..self.len()).into_par_iter().step_by(CHUNK);
        let follow = |start: usize| {
            let mut part = part();
            // After 0, 1, 2 … vertices of the list at hand; more than it has vertices are left from others.
            let mut states = vec![S::default()];
            let mut known = 0;
            for code in start..self.len().min(start + CHUNK) {
                let (&last, before) = (self.list(code as u32).split_last()).unwrap_or((&1.0, &[]));
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
                visit(&mut part, &states[known], last);
            }
            part
        };
        chunks.map(follow).collect()
    }

    /// α′ of every code.
    pub fn alphas(&self, table: &AttenuationTable) -> Vec<f32> {
        let parts = self.follow(
            || Vec::with_capacity(CHUNK),
            |path: &mut PathRoughness, alpha| path.push(alpha, table, 1.0),
            |part: &mut Vec<f32>, path, last| part.push(path.accumulate(last, table, 1.0)),
        );
        parts.concat()
    }

    /// α′ and derivative of every code.
    pub fn roughness(&self, table: &AttenuationTable) -> Roughness {
        let parts = self.follow(
            Part::empty,
            |path: &mut Differentiated, alpha| path.push(alpha, table),
            |part: &mut Part, path, last| {
                let start = part.entries.len() as u32;
                let alpha = path.accumulate(last, table, &mut part.entries);
                part.codes.push((alpha, start));
            },
        );
        Roughness { parts }
    }

    /// Whether a path folds: α′ then depends on the factors of more than one class.
    pub fn is_long(&self, code: u32) -> bool {
        self.list(code).len() > MAX_VERTICES
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regularise::accumulate_with_gradient;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn codes_that_begin_alike_are_followed_as_each_alone() {
        let mut rng = rand_pcg::Pcg32::seed_from_u64(3);
        let values = [0.0, 0.02, 0.1, 0.3, 0.7, 1.0];
        let mut tree = Interner::default();
        let mut lists = Vec::new();
        // More than a chunk, so that one begins in the middle of lists that begin alike.
        for _ in 0..4 * CHUNK {
            let n = rng.random_range(1..12);
            let list: Vec<f32> = (0..n).map(|_| values[rng.random_range(0..6)]).collect();
            let intern = |at: Option<u32>, alpha: &f32| Some(tree.intern(at, *alpha));
            if let Some(code) = list.iter().fold(None, intern) {
                lists.push((list, code));
            }
        }
        lists.retain(|(_, code)| code % 7 != 0);
        let mut used = vec![false; tree.len()];
        for (list, code) in &lists {
            assert_eq!(&tree.list(*code), list);
            used[*code as usize] = true;
        }
        let (codes, place) = tree.codes(&used);
        assert_eq!(codes.len(), used.iter().filter(|u| **u).count());
        // Another tree that has some of the lists already.
        let mut other = Interner::default();
        let first = other.intern(None, 0.3);
        other.intern(Some(first), 0.7);
        let moved = other.absorb(&tree, used.clone());
        for (list, code) in &lists {
            assert_eq!(&other.list(moved[*code as usize]), list);
        }
        assert!(other.len() < tree.len());
        assert!(codes.len() > 2 * CHUNK && codes.shared.iter().any(|&s| s > 3));
        let mut table = AttenuationTable::constant(0.0);
        table.gammas.fill_with(|| rng.random());
        let (alphas, roughness) = (codes.alphas(&table), codes.roughness(&table));
        for (list, old) in &lists {
            let code = place[*old as usize];
            assert_eq!(codes.list(code), list);
            let (alpha, gradient) = accumulate_with_gradient(list, &table);
            assert_eq!(alphas[code as usize], alpha);
            assert_eq!(roughness.at(code), (alpha, &gradient[..]));
        }
        // In any order, and after others.
        let mut gathered = Gathered::default();
        for step in [3, 7] {
            let some = (0..codes.len() as u32).rev().step_by(step);
            roughness.gather(some.clone(), &mut gathered);
            assert!((gathered.iter()).eq(some.map(|code| roughness.at(code))));
        }
        let (long, all) = codes.long();
        for (code, &of_all) in (0u32..).zip(&all) {
            assert_eq!(long.list(code), codes.list(of_all));
        }
        let folds = (0..codes.len() as u32).filter(|&code| codes.is_long(code));
        assert!(folds.eq(all));
    }
}
