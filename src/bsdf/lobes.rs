//! The closures.

use super::Distribution;
use crate::math::Rgb;

/// Lambert.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Reflectance in [0, 1].
    pub albedo: Rgb,
}

/// Microfacet reflection over a Lambertian base.
#[derive(Clone, Copy, Debug)]
pub struct Glossy {
    /// Reflectance at normal incidence in [0, 1] (Schlick).
    pub f0: Rgb,
    /// Reflectance of the base in [0, 1]; zero for a metal.
    pub albedo: Rgb,
    /// Own roughness.
    pub alpha: f32,
    /// Slope distribution.
    pub distribution: Distribution,
}

/// Interface between the outside (`z > 0`) and a solid body.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index of refraction inside over outside, >= 1 usually.
    pub eta: f32,
    /// Tint of the transmitted light in [0, 1].
    pub tint: Rgb,
    /// Own roughness.
    pub alpha: f32,
    /// Slope distribution.
    pub distribution: Distribution,
}

/// Thin wall.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Reflectance at normal incidence (Schlick).
    pub f0: Rgb,
    /// Tint of the transmitted light in [0, 1].
    pub tint: Rgb,
    /// Own roughness.
    pub alpha: f32,
    /// Slope distribution.
    pub distribution: Distribution,
}
