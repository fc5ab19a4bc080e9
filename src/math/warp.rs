//! Maps from the unit square [0, 1)² and their densities.

use super::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// Uniform point of the unit disk, density 1/π per area, by the concentric map (Shirley, Chiu: *A Low Distortion Map
/// Between Disk and Square*, 1997).
#[inline]
pub(crate) fn disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, phi) = if p.x.abs() > p.y.abs() {
        (p.x, 0.25 * PI * (p.y / p.x))
    } else {
        (p.y, 0.5 * PI - 0.25 * PI * (p.x / p.y))
    };
    r * Vec2::new(phi.cos(), phi.sin())
}

/// Cosine-weighted direction of the upper hemisphere, density cos θ / π per steradian.
#[inline]
pub(crate) fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = disk(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Barycentric weights of the second and third corner for a uniform point of a triangle, density 1/area per area.
#[inline]
pub(crate) fn triangle(u: Vec2) -> Vec2 {
    let root = u.x.sqrt();
    Vec2::new(root * (1.0 - u.y), root * u.y)
}

/// Uniform direction of the sphere, density 1/(4π) per steradian.
#[inline]
pub(crate) fn sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (4.0 * u.x * (1.0 - u.x)).max(0.0).sqrt();
    let phi = 2.0 * PI * u.y;
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// Uniform direction of the cone about +z whose half angle has 1 − cos = `width`, density 1/(2π `width`) per steradian.
#[inline]
pub(crate) fn cone(u: Vec2, width: f32) -> Vec3 {
    let z = 1.0 - u.x * width;
    let r = (u.x * width * (2.0 - u.x * width)).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`sphere`], per steradian.
pub(crate) const SPHERE_PDF: f32 = 0.25 * FRAC_1_PI;
