//! The roughness lists of paths, each kept once.
//!
//! α′ and its derivative depend on the list of roughness values alone, of which there are far fewer than events: they
//! are computed per list ("code"), not per event.

use crate::regularise::{
    AttenuationTable, Dependence, Differentiated, GammaIndex, MAX_VERTICES, PathRoughness,
};
use rayon::prelude::*;
use std::ops::Range;

/// RoughnessLists that one thread takes at a time.
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

/// Distinct lists of own roughness of paths, camera first, last vertex last; such that begin alike are next to one
/// another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoughnessLists {
    lists: Lists,
    /// With how many values of the list before it each begins.
    shared: Vec<u32>,
}

/// α′ of all codes and what it depends on.
#[derive(Clone, Debug, Default)]
pub struct ListAlphas {
    /// Of [`CHUNK`] codes each.
    parts: Vec<AlphaChunk>,
}

/// Dependences that are kept beside α′: those of a path of up to nine vertices whose factors are not interpolated.
const BESIDE: usize = 2;

/// α′ of a code and what it depends on; read at random, and so in one piece.
#[derive(Clone, Copy, Debug, Default)]
struct ListAlpha {
    alpha: f32,
    /// How many dependences there are, and where the part has them if they are more than are kept here.
    count: u32,
    start: u32,
    beside: [(GammaIndex, f32); BESIDE],
}

/// α′ of some codes, and the dependences of those that have many, one after the other.
#[derive(Clone, Debug, Default)]
struct AlphaChunk {
    heads: Vec<ListAlpha>,
    entries: Dependence,
    /// Those of the code at hand.
    own: Dependence,
}

impl AlphaChunk {
    /// Of no codes, with room for them.
    fn empty() -> Self {
        Self {
            heads: Vec::with_capacity(CHUNK),
            ..Self::default()
        }
    }

    fn push(&mut self, path: &Differentiated, last: f32, table: &AttenuationTable) {
        self.own.clear();
        let mut head = ListAlpha {
            alpha: path.accumulate(last, table, &mut self.own),
            count: self.own.len() as u32,
            start: self.entries.len() as u32,
            ..ListAlpha::default()
        };
        match head.beside.get_mut(..self.own.len()) {
            Some(beside) => beside.copy_from_slice(&self.own),
            None => self.entries.extend(&self.own),
        }
        self.heads.push(head);
    }
}

/// α′ of some codes and what it depends on, in the order in which they are needed.
#[derive(Debug, Default)]
pub(in crate::train) struct PrefetchBuffer {
    heads: Vec<(ListAlpha, u32)>,
}

impl ListAlphas {
    /// Brings what some codes have close together.
    ///
    /// In a loop that does nothing else, so that the waits for memory are many at a time and not one after the other.
    pub(in crate::train) fn gather(
        &self,
        codes: impl Iterator<Item = u32>,
        to: &mut PrefetchBuffer,
    ) {
        to.heads.clear();
        to.heads.extend(codes.map(|code| (*self.head(code), code)));
    }

    /// What was gathered here.
    pub(in crate::train) fn gathered<'a>(
        &'a self,
        gathered: &'a PrefetchBuffer,
    ) -> impl Iterator<Item = (f32, &'a [(GammaIndex, f32)])> {
        let heads = gathered.heads.iter();
        heads.map(|(head, code)| (head.alpha, self.entries(head, *code)))
    }

    fn head(&self, code: u32) -> &ListAlpha {
        &self.parts[code as usize / CHUNK].heads[code as usize % CHUNK]
    }

    #[inline]
    fn entries<'a>(&'a self, head: &'a ListAlpha, code: u32) -> &'a [(GammaIndex, f32)] {
        let count = head.count as usize;
        head.beside.get(..count).unwrap_or_else(|| {
            let entries = &self.parts[code as usize / CHUNK].entries;
            &entries[head.start as usize..][..count]
        })
    }

    /// Accumulated roughness of a code, and its derivatives by the table entries it depends on.
    #[inline]
    pub fn at(&self, code: u32) -> (f32, &[(GammaIndex, f32)]) {
        let head = self.head(code);
        (head.alpha, self.entries(head, code))
    }
}

impl RoughnessLists {
    /// Of sorted lists.
    pub(in crate::train) fn of<'a>(lists: impl Iterator<Item = &'a [f32]>) -> Self {
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
    pub fn roughness(&self, table: &AttenuationTable) -> ListAlphas {
        let parts = self.follow(
            AlphaChunk::empty,
            |path: &mut Differentiated, alpha| path.push(alpha, table),
            |part: &mut AlphaChunk, path, last| part.push(path, last, table),
        );
        ListAlphas { parts }
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
    use crate::train::record::intern::Interner;
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
        let mut gathered = PrefetchBuffer::default();
        for step in [3, 7] {
            let some = (0..codes.len() as u32).rev().step_by(step);
            roughness.gather(some.clone(), &mut gathered);
            let found = roughness.gathered(&gathered);
            assert!(found.eq(some.map(|code| roughness.at(code))));
        }
        let (long, all) = codes.long();
        for (code, &of_all) in (0u32..).zip(&all) {
            assert_eq!(long.list(code), codes.list(of_all));
        }
        let folds = (0..codes.len() as u32).filter(|&code| codes.is_long(code));
        assert!(folds.eq(all));
    }
}
