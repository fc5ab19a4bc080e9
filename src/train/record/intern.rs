//! The roughness lists of paths while they are traced.

use crate::train::record::lists::RoughnessLists;
use foldhash::fast::FixedState;
use rayon::prelude::*;
use std::collections::HashMap;

/// The vertices that paths were traced to, as a tree: each stands for the list that leads to it.
#[derive(Clone, Debug, Default)]
pub(in crate::train) struct Interner {
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
    pub(in crate::train) fn intern(&mut self, before: Option<u32>, alpha: f32) -> u32 {
        let next = self.nodes.len() as u32;
        *(self.index.entry(key(before, alpha))).or_insert_with(|| {
            self.nodes.push((before, alpha));
            next
        })
    }

    /// How many lists there are.
    pub(in crate::train) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The list with a number.
    pub(in crate::train) fn list(&self, code: u32) -> Vec<f32> {
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
    pub(in crate::train) fn absorb(&mut self, other: &Self, mut used: Vec<bool>) -> Vec<u32> {
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
    pub(in crate::train) fn codes(&self, used: &[bool]) -> (RoughnessLists, Vec<u32>) {
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
            RoughnessLists::of(lists.iter().map(|(list, _)| list.as_slice())),
            place,
        )
    }
}
