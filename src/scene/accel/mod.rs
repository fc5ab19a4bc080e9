//! The tree over triangles: built by obvhs (its only user), folded to eight children a node, and walked with AVX2 where
//! the processor has it.
//!
//! Both walks compute the same triangle test to the bit and break ties by index, so a hit depends neither on the
//! processor nor on the number of threads that built the tree.

use super::Hit;
use crate::math::{Ray, Vec3};

mod portable;
mod triangle;
mod wide;

use wide::Wide;

/// A tree over a list of triangles; indices of hits are indices of that list.
pub struct Accel {
    tree: Wide,
}

impl Accel {
    /// Builds the tree. Triangles with a coordinate that is not finite or beyond 1e17 are never hit.
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        Self {
            tree: Wide::new(triangles),
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
        portable::walk::<false>(&self.tree, ray, keep)
    }

    /// Whether there is a hit that `keep` accepts.
    #[inline]
    pub fn any_where(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> bool {
        portable::walk::<true>(&self.tree, ray, keep).is_some()
    }

    /// Lower and upper corner of all triangles; both zero if there are none.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.tree.bounds
    }
}
