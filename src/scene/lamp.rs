//! Lamp surfaces of modelling programs: invisible to the camera, or with emission into a cone.

use super::material::Material;
use crate::math::Vec3;

/// Properties that only a lamp's surface has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lamp {
    /// True if camera rays pass through it from either side. All other rays hit it.
    pub hidden: bool,
    /// Cone into which it emits; `None` for all directions.
    pub cone: Option<Cone>,
}

/// A cone of directions with a soft edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit axis in world space, away from the lamp.
    pub direction: Vec3,
    /// Cosine of the angle at which the fall-off begins.
    pub cos_inner: f32,
    /// Cosine of the angle at which the fall-off ends, below `cos_inner`.
    pub cos_outer: f32,
}

impl Cone {
    /// Share of the radiance in [0, 1] that leaves along the unit vector `dir`: a smooth step in the cosine, as in
    /// Blender's spots.
    pub(crate) fn share(&self, dir: Vec3) -> f32 {
        let width = self.cos_inner - self.cos_outer;
        let x = ((dir.dot(self.direction) - self.cos_outer) / width).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }
}

impl Material {
    /// Properties of a lamp, if it is one.
    pub fn lamp(&self) -> Option<&Lamp> {
        self.finish.as_ref()?.lamp.as_ref()
    }

    /// The cone into which it emits.
    pub(super) fn cone(&self) -> Option<&Cone> {
        self.lamp()?.cone.as_ref()
    }

    /// True if camera rays pass through it.
    pub(crate) fn is_hidden(&self) -> bool {
        self.lamp().is_some_and(|lamp| lamp.hidden)
    }
}
