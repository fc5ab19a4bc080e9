//! All lights of a scene: one of them is drawn by power, then a point or a direction of it.
//!
//! [`Lights`] owns copies of what it samples (emissive triangles, their materials, lights without area, the
//! environment; texels and maps are shared), so that light sampling never asks the scene back.

mod area;
pub mod emission;
mod environment;
mod punctual;

pub use emission::{EmissionDensity, EmissionSample};
pub use environment::Environment;
pub use punctual::PunctualLight;

use super::{Geometry, Hit, SceneParts, Surface};
use crate::math::discrete::AliasTable;
use crate::math::measure::balance;
use crate::math::{Ray, Rgb, Vec2, Vec3, luminance};
use area::AreaLights;
use emission::Sphere;
use std::f32::consts::PI;

/// A direction towards a light, drawn from a point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub wi: Vec3,
    /// Distance to the light's surface; infinity for the environment and for directional lights.
    pub distance: f32,
    /// Radiance arriving from there; for lights without area the irradiance on a plane facing them.
    pub radiance: Rgb,
    /// Density of the sample, choice of the light included.
    pub density: LightDensity,
    /// Absolute cosine between the direction and the light's surface; 1 where it has none.
    pub cos: f32,
    /// Bound of the rounding error of the light's surface along its normal; 0 for lights at infinity.
    pub error: f32,
    /// Density with which an emission sample that starts there goes to the point: per steradian, or for a light at
    /// infinity per area across the direction. See [`EmissionDensity`].
    pub emission_pdf: f32,
}

/// Density of a [`LightSample`], in the measure of its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightDensity {
    /// Density per steradian, for area lights and the environment.
    SolidAngle(f32),
    /// Probability of the choice, for lights without area; no BSDF sample ever meets one.
    Delta(f32),
}

impl LightDensity {
    /// The number that a sample's contribution is divided by: `pdf_w` or `pmf`.
    #[inline]
    pub fn value(self) -> f32 {
        match self {
            Self::SolidAngle(pdf_w) => pdf_w,
            Self::Delta(pmf) => pmf,
        }
    }

    /// True for lights without area.
    #[inline]
    pub fn is_delta(self) -> bool {
        matches!(self, Self::Delta(_))
    }

    /// MIS weight of the light sample against BSDF samples of density `pdf_w` per steradian (balance heuristic); 1 for
    /// lights without area.
    #[inline]
    pub fn mis_weight(self, pdf_w: f32) -> f32 {
        match self {
            Self::SolidAngle(light) => balance(light, pdf_w),
            Self::Delta(_) => 1.0,
        }
    }
}

/// Emission found at the end of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Emitted radiance towards the ray's origin.
    pub radiance: Rgb,
    /// Density per steradian with which [`Lights::sample`] from the origin draws the ray's direction.
    pub pdf_w: f32,
    /// Distance; infinity for the environment.
    pub distance: f32,
}

/// All lights of a scene and the distribution over them.
pub struct Lights {
    /// Choice by power: emissive triangles first, then lights without area, then the environment.
    choice: AliasTable,
    area: AreaLights,
    punctual: Vec<PunctualLight>,
    environment: Option<Environment>,
    environment_pmf: f32,
    /// The sphere round the scene, through which light from infinity enters.
    sphere: Sphere,
}

impl Lights {
    /// Collects the lights and weighs them by power.
    pub fn new(parts: &SceneParts, geometry: &Geometry, warnings: &mut Vec<String>) -> Self {
        let (low, high) = geometry.bounds();
        // Light from infinity enters the scene through a disk of the scene's radius.
        let disk = f64::from(PI * (0.25 * low.distance_squared(high)).max(1e-12));
        let mut area = AreaLights::new(parts, geometry);
        let mut powers = area.powers();
        powers.extend(parts.lights.iter().map(|light| light.power(disk)));
        let sky = |e: &Environment| f64::from(luminance(e.average())) * f64::from(PI) * disk;
        powers.extend(parts.environment.iter().map(sky));
        let choice = AliasTable::new(&powers);
        if choice.is_empty() {
            warnings.push("no light: the picture will be black".into());
            area = AreaLights::default();
        }
        area.set_densities(|k| choice.pmf(k));
        let environment_pmf = match &parts.environment {
            Some(_) if !choice.is_empty() => choice.pmf(powers.len() - 1),
            _ => 0.0,
        };
        Self {
            choice,
            area,
            punctual: parts.lights.clone(),
            environment: parts.environment.clone(),
            environment_pmf,
            sphere: Sphere::around(geometry.bounds()),
        }
    }

    /// True if nothing emits.
    pub fn is_empty(&self) -> bool {
        self.choice.is_empty()
    }

    /// Number of emissive triangles.
    pub fn emissive_triangles(&self) -> usize {
        self.area.len()
    }

    /// Draws a light and a point on it, as seen from `from`. `None` where the light drawn does not reach `from`.
    /// Visibility is not tested.
    #[inline]
    pub fn sample(&self, from: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let (k, _) = self.choice.sample(u[0])?;
        let at = Vec2::new(u[1], u[2]);
        let Some(rest) = k.checked_sub(self.area.len()) else {
            return self.area.sample(k, from, at);
        };
        let pmf = self.choice.pmf(k);
        if let Some(light) = self.punctual.get(rest) {
            return light.illuminate(from, pmf, self.sphere.pdf());
        }
        let (wi, radiance, pdf_w) = self.environment.as_ref()?.sample(at)?;
        Some(LightSample {
            wi,
            distance: f32::INFINITY,
            radiance,
            density: LightDensity::SolidAngle(pdf_w * pmf),
            cos: 1.0,
            error: 0.0,
            emission_pdf: self.sphere.pdf(),
        })
    }

    /// Radiance emitted by a surface point towards `wo` (world); zero for most surfaces and for unlit sides.
    #[inline]
    pub fn emitted(&self, surface: &Surface, wo: Vec3) -> Rgb {
        self.area.emitted(surface, wo)
    }

    /// Density per steradian with which [`Lights::sample`] from `from` draws the direction to that emitting point.
    #[inline]
    pub fn pdf_emitter(&self, from: Vec3, surface: &Surface) -> f32 {
        self.area.pdf(from, surface)
    }

    /// Radiance seen from the scene when looking along `dir` past all surfaces.
    #[inline]
    pub fn environment(&self, dir: Vec3) -> Rgb {
        (self.environment.as_ref()).map_or(Rgb::ZERO, |e| e.radiance(dir))
    }

    /// Density per steradian with which [`Lights::sample`] draws the direction `dir` from the environment.
    #[inline]
    pub fn pdf_environment(&self, dir: Vec3) -> f32 {
        (self.environment.as_ref()).map_or(0.0, |e| e.pdf(dir) * self.environment_pmf)
    }

    /// The closest emissive triangle along a ray, the rest of the scene left out: most rays meet none and are done.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.area.closest(ray)
    }
}
