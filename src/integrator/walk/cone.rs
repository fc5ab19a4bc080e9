//! The cone of directions over which a mollified Dirac lobe is spread `[PSR (5)]`.

use crate::math::Vec3;
use std::f32::consts::TAU;

/// A cone of directions.
pub(in crate::integrator) struct Cone {
    /// 1 − cos ε.
    width: f32,
}

impl Cone {
    /// The cone that a kernel of radius r at distance d subtends: ε = atan(r/d).
    #[inline]
    pub(in crate::integrator) fn new(radius: f32, distance: f32) -> Self {
        let tan = radius / distance;
        let secant = (1.0 + tan * tan).sqrt();
        // 1 − 1/secant without the difference of numbers near 1.
        let width = tan * tan / (secant * (secant + 1.0));
        Self { width }
    }

    /// Density per steradian of a uniform direction in the cone about `axis`; 0 outside.
    #[inline]
    pub(in crate::integrator) fn density(&self, axis: Vec3, dir: Vec3) -> f32 {
        if 0.5 * axis.distance_squared(dir) < self.width {
            1.0 / (TAU * self.width)
        } else {
            0.0
        }
    }
}
