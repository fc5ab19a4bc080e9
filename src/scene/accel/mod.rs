//! The bounding volume hierarchy over triangles: built by obvhs (its only user), folded to eight children a node, and
//! traversed with AVX2 where the processor has it.
//!
//! Both traversals compute bit-identical triangle tests and break ties by index, so a hit depends neither on the
//! processor nor on the number of threads that built the tree.

use super::Hit;
use crate::math::{DVec3, Ray, Vec3};

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;
#[cfg(test)]
mod tests;
mod triangle;
mod wide;

pub(crate) use triangle::LocalRay;
use triangle::TreeRay;
use wide::Wide;

/// An empty list of this capacity, in huge pages where the system has them.
pub(crate) fn huge_list<T>(capacity: usize) -> Vec<T> {
    #[cfg(target_arch = "x86_64")]
    return avx2::huge_list(capacity);
    #[cfg(not(target_arch = "x86_64"))]
    Vec::with_capacity(capacity)
}

/// Prefetches an item of a list that will soon be read.
#[inline(always)]
pub(crate) fn prefetch<T>(list: &[T], index: u32) {
    #[cfg(target_arch = "x86_64")]
    if let Some(item) = list.get(index as usize) {
        avx2::prefetch_item(item);
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (list, index);
}

/// The instances in a tree, for a traversal.
pub(crate) trait InstanceHits {
    /// True if there are any.
    const SOME: bool;

    /// The hit in an instance that is closer than `best`; any such hit for a traversal that stops at the first.
    fn hit(&self, instance: u32, best: &Hit) -> Option<Hit>;
}

/// No instances.
impl InstanceHits for () {
    const SOME: bool = false;

    #[inline(always)]
    fn hit(&self, _: u32, _: &Hit) -> Option<Hit> {
        None
    }
}

impl<F: Fn(u32, &Hit) -> Option<Hit>> InstanceHits for F {
    const SOME: bool = true;

    #[inline(always)]
    fn hit(&self, instance: u32, best: &Hit) -> Option<Hit> {
        self(instance, best)
    }
}

/// A tree over a list of triangles, and over instances; indices of hits are indices of that list.
pub struct Accel {
    tree: Wide,
    #[cfg(target_arch = "x86_64")]
    simd: Option<avx2::Avx2>,
}

impl Accel {
    /// Coordinates beyond this are not accepted.
    pub(crate) const LIMIT: f32 = wide::LIMIT;

    /// Builds the tree. Triangles with a coordinate that is not finite or beyond 1e17 are never hit.
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        Self::over(triangles.len(), |i| triangles[i as usize], &[])
    }

    /// Builds the tree over `count` triangles of a function, since a list would take more memory, and over instances
    /// with these lower and upper corners of boxes within 1e17.
    pub(crate) fn over(
        count: usize,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
        instances: &[(Vec3, Vec3)],
    ) -> Self {
        Self {
            tree: Wide::new(count, corners, instances),
            #[cfg(target_arch = "x86_64")]
            simd: avx2::Avx2::detect(),
        }
    }

    /// The same tree, traversed in portable Rust on any processor: the reference for the AVX2 traversal.
    pub fn portable(triangles: &[[Vec3; 3]]) -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            simd: None,
            ..Self::new(triangles)
        }
    }

    /// Only the bounds of triangles and instances: rays hit nothing.
    pub(crate) fn bounds_only(
        triangles: impl Iterator<Item = [Vec3; 3]>,
        instances: &[(Vec3, Vec3)],
    ) -> Self {
        Self {
            tree: Wide::bounds_only(triangles, instances),
            #[cfg(target_arch = "x86_64")]
            simd: None,
        }
    }

    /// True if the tree can hold the triangle: all coordinates finite and not beyond 1e17.
    pub(crate) fn accepts(triangle: &[Vec3; 3]) -> bool {
        wide::usable(triangle)
    }

    /// The closest hit with 0 < t < `t_max`, from either side; instances are left out.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.closest_where(ray, |_| true)
    }

    /// True if there is any hit with 0 < t < `t_max`.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.any_where(ray, |_| true)
    }

    /// The closest of the hits that `keep` accepts.
    #[inline]
    pub(crate) fn closest_where(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.find_hit::<false>(ray, keep, ())
    }

    /// True if there is a hit that `keep` accepts.
    #[inline]
    pub(crate) fn any_where(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> bool {
        self.find_hit::<true>(ray, keep, ()).is_some()
    }

    /// The closest hit that `keep` accepts, or that an instance finds by `enter`; with `ANY` the first to be found.
    #[inline]
    pub(crate) fn among<const ANY: bool>(
        &self,
        ray: &Ray,
        keep: impl Fn(&Hit) -> bool,
        enter: impl InstanceHits,
    ) -> Option<Hit> {
        self.find_hit::<ANY>(ray, keep, enter)
    }

    /// A hit of a ray in the tree's own space that `keep` accepts and that is closer than the ray's best one: the
    /// closest, or with `ANY` the first found.
    #[inline]
    pub(crate) fn closer_hit<const ANY: bool>(
        &self,
        ray: &LocalRay,
        keep: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        self.find_hit::<ANY>(ray, keep, ())
    }

    #[inline]
    fn find_hit<const ANY: bool>(
        &self,
        probe: &impl TreeRay,
        keep: impl Fn(&Hit) -> bool,
        enter: impl InstanceHits,
    ) -> Option<Hit> {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.simd {
            return simd.find_hit::<ANY>(&self.tree, probe, keep, enter);
        }
        portable::find_hit::<ANY, _>(&self.tree, probe, keep, enter)
    }

    /// The greatest p · `dir` over the points p of all triangles, or a slightly larger bound; at least one must exist.
    pub(crate) fn reach(&self, dir: DVec3) -> f64 {
        self.tree.reach(dir)
    }

    /// Lower and upper corner of all triangles and instances; both zero if there are none.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        self.tree.bounds
    }
}
