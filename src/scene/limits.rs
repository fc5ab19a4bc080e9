//! Sizes of scenes: the most that one may have, and the memory that its parts take.

/// Most vertices, and most triangles, of a scene in memory. Instances and shared accessors let a small file ask for any
/// number.
pub const MAX_ELEMENTS: u64 = 1 << 26;

/// Most meshes, one per primitive and instance.
pub const MAX_MESHES: usize = 1 << 20;

/// Bytes of copies above which meshes are shared. Rays meet copies faster, so small scenes keep them.
pub const MAX_COPIES: u64 = 256 << 20;

/// Least triangles of a mesh that is shared: an instance takes as much memory as a copy of few.
pub const MIN_SHARED: u64 = 16;

/// Bytes of an instance of a shared mesh: its poses, and the tree over all while it is built. Measured: 550.
pub const INSTANCE_BYTES: u64 = 600;

/// Bytes of a triangle beside its mesh: its record, and the tree while it is built. Measured: 240.
pub const TRIANGLE_BYTES: u64 = 260;

/// Bytes of a triangle that emits, beside those: trees of its own. Measured: 265.
pub const EMITTER_BYTES: u64 = 290;
