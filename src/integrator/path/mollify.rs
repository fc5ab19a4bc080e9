//! The mollifier: lights without area seen by way of smooth mirrors and glass.

use crate::integrator::walk::shading_point::{Here, Next};
use crate::math::{Rgb, Vec3};
use std::f32::consts::TAU;

/// The cone of directions that a mollified Dirac lobe is spread over.
struct Cone {
    /// 1 − cos ε.
    width: f32,
}

impl Cone {
    /// The cone in which a kernel of radius r at distance d is seen: ε = atan(r/d).
    fn new(radius: f32, distance: f32) -> Self {
        let tan = radius / distance;
        let secant = (1.0 + tan * tan).sqrt();
        // 1 − 1/s without the difference of numbers near 1.
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

impl Here<'_> {
    /// Light from a light without area, let in by the Dirac lobe that was drawn as if it were spread evenly over a
    /// cone `[PSR]`. Nothing else can find such a light, so nothing is counted twice.
    ///
    /// `radius` is that of the kernel at the light, over half the diagonal of the scene.
    pub(super) fn mollified(&self, next: &Next, radius: f32, u: [f32; 3]) -> Rgb {
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
        if self.scene.occluded(&self.surface.spawn_to_light(&light)) {
            return Rgb::ZERO;
        }
        let transmittance = self.transmittance(light.wi, light.distance);
        self.throughput
            * next.sample.weight
            * light.radiance
            * transmittance
            * (cone.density() / light.density.value())
    }
}
