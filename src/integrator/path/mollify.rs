//! The mollifier: lights without area, seen through smooth mirrors and glass `[PSR]`.

use crate::integrator::walk::cone::Cone;
use crate::integrator::walk::shading_point::{Continuation, ShadingPoint};
use crate::math::Rgb;
use crate::sampler::LightU;

impl ShadingPoint<'_> {
    /// Contribution of a light without area through the Dirac lobe that was drawn, as if that lobe were spread evenly
    /// over a cone. Nothing else can find such a light, so nothing is counted twice.
    ///
    /// `radius` is the kernel's at the light, over half the diagonal of the scene.
    pub(super) fn mollified(&self, next: &Continuation, radius: f32, u: LightU) -> Rgb {
        if self.scene.parts().lights.is_empty() {
            return Rgb::ZERO;
        }
        let Some(light) = self.scene.lights().sample(self.surface.position, u) else {
            return Rgb::ZERO;
        };
        let (low, high) = self.scene.geometry().bounds();
        let extent = 0.5 * (high - low).length();
        // A light at infinity is treated as one at the distance of the scene's diagonal.
        let cone = Cone::new(radius * extent, light.distance.min(2.0 * extent));
        let density = cone.density(next.wi, light.wi);
        let ng = self.surface.ng;
        let same_side = light.wi.dot(ng) * next.wi.dot(ng) > 0.0;
        if !light.density.is_delta() || !same_side || density == 0.0 {
            return Rgb::ZERO;
        }
        let Some(transmittance) = self.transmittance_to(&light) else {
            return Rgb::ZERO;
        };
        self.throughput
            * next.sample.weight
            * light.radiance
            * transmittance
            * (density / light.density.value())
    }
}
