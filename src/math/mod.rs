//! Mathematics without physics: vectors, frames, measures, warps, distributions, dual numbers. Depends on glam only.

pub(crate) mod discrete;
pub(crate) mod exact;
pub(crate) mod frame;
pub mod measure;
pub mod moments;
pub mod real;
pub(crate) mod warp;

pub use frame::Frame;
pub use glam::{DVec2, DVec3, UVec2, Vec2, Vec3, Vec3A, Vec4};

/// Linear RGB (Rec. 709 primaries): radiance, irradiance, reflectance or throughput.
pub type Rgb = Vec3;

/// Ray `origin + t * dir`, 0 < t < `t_max`. `dir` has unit length, so `t` is a distance.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Starting point, already offset from the surface that the ray leaves.
    pub origin: Vec3,
    /// Unit direction.
    pub dir: Vec3,
    /// Exclusive upper bound of the distance of a hit; infinity for an unbounded ray.
    pub t_max: f32,
}

impl Ray {
    /// Unbounded ray.
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        Self {
            origin,
            dir,
            t_max: f32::INFINITY,
        }
    }
}

/// Rec. 709 luminance of linear RGB.
#[inline]
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}
