//! Identifiers of triangles, and hits of rays.

/// Identifier of a triangle: its index in memory and its instance, since all instances together may show more than 2³²
/// triangles. Its order is scene order: unshared triangles, then instance by instance.
///
/// Stored as one number, so that it is copied as one, but with the alignment of the other fields of [`Hit`].
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
    pub(crate) const fn single(index: u32) -> Self {
        Self::new(0, index)
    }

    /// Number of the instance, from 1; 0 for a triangle that no instances share.
    #[inline(always)]
    pub(crate) const fn instance(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Index among the triangles in memory: those that no instances share, then those of each shared mesh once.
    #[inline(always)]
    pub(crate) const fn index(self) -> u32 {
        self.0 as u32
    }

    /// Both numbers in one.
    #[inline(always)]
    pub(super) fn bits(self) -> u64 {
        self.0
    }

    /// The triangle `places` positions after this one in the same mesh.
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
