//! The watertight ray-triangle test `[Woop13]`, in the one form that every walk computes.
//!
//! The triangle's corners are moved and sheared so that the ray becomes the z axis; what is left is a point-in-triangle
//! test in the plane. A corner is mapped alike for every triangle that shares it, and an edge function is the difference
//! of two rounded products: swapping the edge's ends negates it exactly, and rounding is monotonic, so its sign, unless
//! zero, is the exact one. Zero counts as inside for both neighbours. Hence no ray slips through a shared edge.
//!
//! Multiply-add is *not* fused here: fusing rounds only one of the two products and loses that symmetry. It also makes
//! the results the same bits with and without AVX2.

use crate::math::{Ray, Vec3};

/// What the test needs to know of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shear {
    /// The two minor axes, then the one along which the ray is longest.
    pub(super) axes: [usize; 3],
    /// Shear along the first and second axis, and the scale of the third.
    pub(super) scale: [f32; 3],
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
            scale: [dir[x] / dir[z], dir[y] / dir[z], 1.0 / dir[z]],
        }
    }
}

/// Distance and the weights of the second and third corner; NaN or infinite distance for a triangle seen edge-on.
/// `corner(k, axis)` reads a coordinate.
#[inline]
pub(super) fn intersect(
    ray: &Ray,
    shear: &Shear,
    corner: impl Fn(usize, usize) -> f32,
) -> Option<(f32, f32, f32)> {
    let [x, y, z] = shear.axes;
    let [sx, sy, sz] = shear.scale;
    let map = |k: usize| {
        let cz = corner(k, z) - ray.origin[z];
        (
            (corner(k, x) - ray.origin[x]) - sx * cz,
            (corner(k, y) - ray.origin[y]) - sy * cz,
            sz * cz,
        )
    };
    let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (map(0), map(1), map(2));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if !inside {
        return None;
    }
    let r = 1.0 / (u + v + w);
    let t = (u * az + v * bz + w * cz) * r;
    Some((t, v * r, w * r))
}
