//! Triangles of a scene, and where rays meet them.

/// A triangle of a scene: where it is in memory, and which instance shows it, since all instances together may show more than
/// 32 bits count. Sorted in scene order: what no instances share, then instance by instance.
///
/// One number, which is copied as one, with the alignment of what surrounds it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(C, packed(4))]
pub struct TriangleId(u64);

impl TriangleId {
    /// A triangle by [`TriangleId::instance`] and [`TriangleId::index`].
    #[inline(always)]
    pub(crate) const fn new(instance: u32, index: u32) -> Self {
        Self((instance as u64) << 32 | index as u64)
    }

    /// A triangle that no instances share.
    #[inline(always)]
    pub const fn single(index: u32) -> Self {
        Self::new(0, index)
    }

    /// Number of the instance, from 1; 0 for a triangle that no instances share.
    #[inline(always)]
    pub const fn instance(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Index among the triangles in memory: those that no instances share, then those of each shared mesh once.
    #[inline(always)]
    pub const fn index(self) -> u32 {
        self.0 as u32
    }

    /// Both numbers in one.
    #[inline(always)]
    pub(super) fn bits(self) -> u64 {
        self.0
    }

    /// The triangle `places` places after this one in the same mesh.
    #[inline(always)]
    pub(crate) fn after(self, places: u32) -> Self {
        Self(self.0 + u64::from(places))
    }
}

/// A ray's closest hit: 20 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// The triangle.
    pub triangle: TriangleId,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}
