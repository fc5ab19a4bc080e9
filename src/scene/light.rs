//! Lights: emissive triangles, the environment, and points without area.

use super::{Geometry, Scene, SceneParts, Surface};
use crate::math::{Ray, Rgb, Vec3};

/// A direction towards a light, drawn from a point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub wi: Vec3,
    /// Distance to the light's surface; infinity for the environment and for directional lights.
    pub distance: f32,
    /// Radiance arriving from there; for lights without area the irradiance on a plane facing them.
    pub radiance: Rgb,
    /// Density per steradian, light choice included; for lights without area the probability of the choice.
    pub pdf_w: f32,
    /// Whether the light has no area: no lobe sample can ever hit it.
    pub delta: bool,
}

/// Emission found at the end of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Emitted radiance towards the ray's origin.
    pub radiance: Rgb,
    /// Density per steradian with which [`Scene::sample_light`] from the origin draws the ray's direction.
    pub pdf_w: f32,
    /// Distance; infinity for the environment.
    pub distance: f32,
}

/// A light without area (`KHR_lights_punctual`), in world space.
#[derive(Clone, Copy, Debug)]
pub enum PunctualLight {
    /// Shines in all directions.
    Point {
        /// Where it is.
        position: Vec3,
        /// Radiant intensity (file's candela taken as W/sr).
        intensity: Rgb,
        /// Cutoff distance, infinity for none.
        range: f32,
    },
    /// Shines into a cone.
    Spot {
        /// Where it is.
        position: Vec3,
        /// Unit axis, the way it shines.
        direction: Vec3,
        /// Radiant intensity on the axis.
        intensity: Rgb,
        /// Cutoff distance, infinity for none.
        range: f32,
        /// Cosine of the angle at which fall-off begins.
        cos_inner: f32,
        /// Cosine of the angle at which it ends.
        cos_outer: f32,
    },
    /// Shines along one direction from infinity.
    Directional {
        /// Unit direction, the way it shines.
        direction: Vec3,
        /// Irradiance on a plane facing it.
        irradiance: Rgb,
    },
}

/// All lights of a scene and the distribution over them.
pub struct Emitters {}

impl Emitters {
    /// Finds emissive triangles and weighs all lights by power.
    pub fn new(parts: &SceneParts, geometry: &Geometry, warnings: &mut Vec<String>) -> Self {
        let _ = (parts, geometry, warnings);
        todo!()
    }

    /// See [`Scene::sample_light`].
    #[inline]
    pub fn sample(
        &self,
        parts: &SceneParts,
        geometry: &Geometry,
        from: Vec3,
        u: [f32; 3],
    ) -> Option<LightSample> {
        let _ = (parts, geometry, from, u);
        todo!()
    }

    /// See [`Scene::emitted`].
    #[inline]
    pub fn emitted(&self, parts: &SceneParts, surface: &Surface, wo: Vec3) -> Rgb {
        let _ = (parts, surface, wo);
        todo!()
    }

    /// See [`Scene::pdf_emitter`].
    #[inline]
    pub fn pdf_emitter(&self, geometry: &Geometry, from: Vec3, surface: &Surface) -> f32 {
        let _ = (geometry, from, surface);
        todo!()
    }

    /// See [`Scene::pdf_environment`].
    #[inline]
    pub fn pdf_environment(&self, parts: &SceneParts, dir: Vec3) -> f32 {
        let _ = (parts, dir);
        todo!()
    }

    /// See [`Scene::emission_along`].
    #[inline]
    pub fn emission_along(&self, scene: &Scene, ray: &Ray) -> Option<Emission> {
        let _ = (scene, ray);
        todo!()
    }
}
