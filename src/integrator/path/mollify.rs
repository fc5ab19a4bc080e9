//! The mollifier: lights without area, seen by way of smooth mirrors and glass `[PSR]`.

use crate::integrator::walk::shading_point::{Continuation, ShadingPoint};
use crate::math::{Rgb, Vec3};
use crate::sampler::LightU;
use std::f32::consts::TAU;

/// The cone of directions over which a mollified Dirac lobe is spread.
struct Cone {
    /// 1 − cos ε.
    width: f32,
}

impl Cone {
    /// The cone that a kernel of radius r at distance d subtends: ε = atan(r/d).
    fn new(radius: f32, distance: f32) -> Self {
        let tan = radius / distance;
        let secant = (1.0 + tan * tan).sqrt();
        // 1 − 1/secant without the difference of numbers near 1.
        let width = tan * tan / (secant * (secant + 1.0));
        Self { width }
    }

    fn holds(&self, axis: Vec3, dir: Vec3) -> bool {
        0.5 * axis.distance_squared(dir) < self.width
    }

    fn density(&self) -> f32 {
        1.0 / (TAU * self.width)
    }
}

impl ShadingPoint<'_> {
    /// Contribution of a light without area through the Dirac lobe that was drawn, as if that lobe were spread evenly
    /// over a cone. Nothing else can find such a light, so nothing is counted twice.
    ///
    /// `radius` is the kernel's at the light, over half the diagonal of the scene.
    pub(super) fn mollified(&self, next: &Continuation, radius: f32, u: LightU) -> Rgb {
        let Some(light) = self.scene.lights().sample(self.surface.position, u) else {
            return Rgb::ZERO;
        };
        let (low, high) = self.scene.geometry().bounds();
        let extent = 0.5 * (high - low).length();
        // A light at infinity counts as being as far as the scene is wide.
        let cone = Cone::new(radius * extent, light.distance.min(2.0 * extent));
        let ng = self.surface.ng;
        let same_side = light.wi.dot(ng) * next.wi.dot(ng) > 0.0;
        if !light.density.is_delta() || !same_side || !cone.holds(next.wi, light.wi) {
            return Rgb::ZERO;
        }
        let Some(transmittance) = self.transmittance_to(&light) else {
            return Rgb::ZERO;
        };
        self.throughput
            * next.sample.weight
            * light.radiance
            * transmittance
            * (cone.density() / light.density.value())
    }
}
