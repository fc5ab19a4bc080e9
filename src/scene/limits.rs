//! Limits on the size of scenes, and the memory that their parts take.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;

/// Most vertices, and most triangles, of a scene in memory. Instances and shared accessors allow a small file to
/// request any number.
pub const MAX_ELEMENTS: u64 = 1 << 26;

/// Most meshes, one per primitive and instance.
pub const MAX_MESHES: usize = 1 << 20;

/// Bytes of copies above which meshes are shared. Small scenes keep copies, since their traversal is faster.
const MAX_COPIES: u64 = 256 << 20;

/// Least number of triangles of a shared mesh: for fewer, a copy takes no more memory than an instance.
const MIN_SHARED: u64 = 16;

/// Bytes of an instance of a shared mesh: its poses, and the tree over all while it is built. Measured: 550.
pub const INSTANCE_BYTES: u64 = 600;

/// Bytes of a triangle: its indices, and 260 (240 were measured) for its record and the tree while it is built. A
/// triangle that emits has 290 more (265 were measured) for the trees over the lights.
pub fn triangle_bytes(emits: bool) -> u64 {
    12 + 260 + if emits { 290 } else { 0 }
}

/// The meshes that are shared: all that are shown more than once and are not small, if their copies would take much
/// memory; else none. `shown` gives a mesh, its number of triangles and the bytes of a copy for each of its uses.
pub fn shared<K: Hash + Eq + Copy>(shown: impl Iterator<Item = (K, u64, u64)>) -> HashSet<K> {
    let (mut uses, mut copies) = (HashMap::<K, u64>::new(), 0u64);
    for (mesh, _, bytes) in shown.filter(|&(_, triangles, _)| triangles >= MIN_SHARED) {
        let used = uses.entry(mesh).or_default();
        *used += 1;
        if *used > 1 {
            copies = copies.saturating_add(bytes);
        }
    }
    let several = uses.into_iter().filter(|&(_, used)| used > 1);
    let shared = several.filter(|_| copies > MAX_COPIES);
    shared.map(|(mesh, _)| mesh).collect()
}
