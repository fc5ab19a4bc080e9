//! The watertight ray-triangle test `[Woop13]`, in the one form that both traversals compute.
//!
//! The triangle's corners are translated and sheared so that the ray becomes the z axis; a point-in-triangle test in the
//! plane remains. A corner is mapped alike for every triangle that shares it, and an edge function is the difference
//! of two rounded products: swapping the edge's ends negates it exactly, and rounding is monotonic, so its sign, unless
//! zero, is the exact one. Zero counts as inside for both neighbours. Hence no ray slips through a shared edge.
//!
//! Multiply-add is *not* fused here: fusing rounds only one of the two products and loses that symmetry. It also makes
//! the results the same bits with and without AVX2.
//!
//! The distance is the plane's, in double precision. `[Woop13]` interpolates it with the edge functions, whose error
//! grows with the triangle's aspect ratio: rays then hit the sliver that they leave. In double precision the sign of t
//! is right for every origin that single precision distinguishes from the plane. The cost is negligible, since few
//! triangles pass the test in the plane.

use crate::math::{DVec3, Ray, Vec3};
use crate::scene::{Hit, TriangleId};

/// A ray in the form that triangle tests need.
pub(super) trait TreeRay {
    /// The ray in single precision, for boxes and for the test in the plane.
    fn ray(&self) -> &Ray;
    /// Origin and direction, for distances.
    fn exact(&self) -> (DVec3, DVec3);
    /// The best hit so far: its distance bounds the search.
    fn best(&self) -> Hit;
    /// Identifier in the scene of a triangle of the tree.
    fn triangle(&self, id: u32) -> TriangleId;
}

impl TreeRay for Ray {
    #[inline(always)]
    fn ray(&self) -> &Ray {
        self
    }

    #[inline(always)]
    fn exact(&self) -> (DVec3, DVec3) {
        (self.origin.as_dvec3(), self.dir.as_dvec3())
    }

    #[inline(always)]
    fn best(&self) -> Hit {
        Hit {
            t: self.t_max,
            ..Hit::default()
        }
    }

    #[inline(always)]
    fn triangle(&self, id: u32) -> TriangleId {
        TriangleId::single(id)
    }
}

/// A ray in the space of an instance's mesh. Its direction has any length, so that distances are those in the world.
///
/// Distances are computed from the ray in double precision, not from the rounded ray: the sign of t is right for every
/// origin that single precision distinguishes from the plane *in the world*, as it is for other triangles.
pub(crate) struct LocalRay {
    /// The ray, rounded.
    pub(crate) ray: Ray,
    /// Its origin.
    pub(crate) origin: DVec3,
    /// Its direction.
    pub(crate) dir: DVec3,
    /// First triangle of the mesh, in this instance.
    pub(crate) first: TriangleId,
    /// The best hit so far.
    pub(crate) best: Hit,
}

impl TreeRay for LocalRay {
    #[inline(always)]
    fn ray(&self) -> &Ray {
        &self.ray
    }

    #[inline(always)]
    fn exact(&self) -> (DVec3, DVec3) {
        (self.origin, self.dir)
    }

    #[inline(always)]
    fn best(&self) -> Hit {
        self.best
    }

    #[inline(always)]
    fn triangle(&self, id: u32) -> TriangleId {
        self.first.after(id)
    }
}

/// Precomputed shear of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shear {
    /// The two minor axes, then the one along which the ray is longest.
    pub(super) axes: [usize; 3],
    /// Movement of the ray along the first and second axis per unit of the third.
    pub(super) slope: [f32; 2],
}

impl Shear {
    #[inline]
    pub(super) fn new(dir: Vec3) -> Self {
        let a = dir.abs();
        let z = if a.x > a.y {
            if a.x > a.z { 0 } else { 2 }
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let x = if z == 2 { 0 } else { z + 1 };
        let y = if x == 2 { 0 } else { x + 1 };
        Self {
            axes: [x, y, z],
            slope: [dir[x] / dir[z], dir[y] / dir[z]],
        }
    }
}

/// Distance and the weights of the second and third corner. `corner(k, axis)` reads a coordinate.
#[inline]
pub(super) fn intersect(
    probe: &impl TreeRay,
    shear: &Shear,
    corner: impl Fn(usize, usize) -> f32,
) -> Option<(f32, f32, f32)> {
    let [x, y, z] = shear.axes;
    let ray = probe.ray();
    let map = |k: usize| {
        let depth = corner(k, z) - ray.origin[z];
        (
            (corner(k, x) - ray.origin[x]) - shear.slope[0] * depth,
            (corner(k, y) - ray.origin[y]) - shear.slope[1] * depth,
        )
    };
    let ((ax, ay), (bx, by), (cx, cy)) = (map(0), map(1), map(2));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let sum = u + v + w;
    if !inside || sum == 0.0 {
        return None;
    }
    let point = |k: usize| DVec3::from_array([0, 1, 2].map(|axis| f64::from(corner(k, axis))));
    let (a, (origin, dir)) = (point(0), probe.exact());
    let (e, f) = (point(1) - a, point(2) - a);
    let n = [
        e.y * f.z - e.z * f.y,
        e.z * f.x - e.x * f.z,
        e.x * f.y - e.y * f.x,
    ];
    let along = |d: DVec3| (n[0] * d.x + n[1] * d.y) + n[2] * d.z;
    let t = (along(a - origin) / along(dir)) as f32;
    let r = 1.0 / sum;
    Some((t, v * r, w * r))
}
