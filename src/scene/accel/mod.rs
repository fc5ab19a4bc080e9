//! The tree over triangles: built by obvhs (its only user), folded to eight children a node, and walked with AVX2 where
//! the processor has it.
//!
//! Both walks compute the same triangle test to the bit and break ties by index, so a hit depends neither on the
//! processor nor on the number of threads that built the tree.

use super::Hit;
use crate::math::{Ray, Vec3};

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;
mod triangle;
mod wide;

use wide::Wide;

/// A tree over a list of triangles; indices of hits are indices of that list.
pub struct Accel {
    tree: Wide,
    #[cfg(target_arch = "x86_64")]
    simd: Option<avx2::Avx2>,
}

impl Accel {
    /// Builds the tree. Triangles with a coordinate that is not finite or beyond 1e17 are never hit.
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        #[allow(unused_mut, reason = "only some targets have huge pages")]
        let mut tree = Wide::new(triangles);
        #[cfg(target_arch = "x86_64")]
        {
            tree.nodes = avx2::in_huge_pages(tree.nodes);
            tree.blocks = avx2::in_huge_pages(tree.blocks);
        }
        Self {
            tree,
            #[cfg(target_arch = "x86_64")]
            simd: avx2::Avx2::detect(),
        }
    }

    /// The same tree, walked in plain Rust whatever the processor can do: the measure of the fast walk.
    pub fn portable(triangles: &[[Vec3; 3]]) -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            simd: None,
            ..Self::new(triangles)
        }
    }

    /// Whether the tree can hold the triangle: all coordinates finite and not beyond 1e17.
    pub fn accepts(triangle: &[Vec3; 3]) -> bool {
        wide::usable(triangle)
    }

    /// The closest hit with 0 < t < `t_max`, from either side.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.closest_where(ray, |_| true)
    }

    /// Whether there is any hit with 0 < t < `t_max`.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.any_where(ray, |_| true)
    }

    /// The closest of the hits that `keep` accepts.
    #[inline]
    pub fn closest_where(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.walk::<false>(ray, keep)
    }

    /// Whether there is a hit that `keep` accepts.
    #[inline]
    pub fn any_where(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> bool {
        self.walk::<true>(ray, keep).is_some()
    }

    #[inline]
    fn walk<const ANY: bool>(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.simd {
            return simd.walk::<ANY>(&self.tree, ray, keep);
        }
        portable::walk::<ANY>(&self.tree, ray, keep)
    }

    /// Lower and upper corner of all triangles; both zero if there are none.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.tree.bounds
    }
}
