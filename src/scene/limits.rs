//! Limits on the size of scenes, and the memory that their parts take.

/// Most vertices, and most triangles, of a scene in memory. Instances and shared accessors allow a small file to
/// request any number.
pub const MAX_ELEMENTS: u64 = 1 << 26;

/// Most meshes, one per primitive and instance.
pub const MAX_MESHES: usize = 1 << 20;

/// Bytes of copies above which meshes are shared. Small scenes keep copies, since their traversal is faster.
pub const MAX_COPIES: u64 = 256 << 20;

/// Least number of triangles of a shared mesh: for fewer, a copy takes no more memory than an instance.
pub const MIN_SHARED: u64 = 16;

/// Bytes of an instance of a shared mesh: its poses, and the tree over all while it is built. Measured: 550.
pub const INSTANCE_BYTES: u64 = 600;

/// Bytes of a triangle in addition to its mesh: its record, and the tree while it is built. Measured: 240.
pub const TRIANGLE_BYTES: u64 = 260;

/// Further bytes of a triangle that emits, for the trees over the lights. Measured: 265.
pub const EMITTER_BYTES: u64 = 290;
