//! All lights of a scene: one is drawn, by power or, if there are many, by a light tree; then a point or a direction of
//! it.
//!
//! [`Lights`] owns copies of what it samples (emissive triangles, their materials, lights without area, the
//! environment; texels and maps are shared), so that light sampling does not access the scene.

pub(crate) mod aim;
mod area;
pub(crate) mod emission;
mod environment;
mod many;
mod punctual;
pub mod sky;
mod tree;

pub(crate) use aim::{Aim, AimShares, Target};
pub(crate) use emission::{EmissionDensity, EmissionSample};
pub use environment::{Environment, read_hdr};
pub use punctual::{Falloff, PunctualLight};

use super::{Geometry, Hit, SceneParts, Surface};
use crate::math::discrete::AliasTable;
use crate::math::measure::balance;
use crate::math::{DVec2, Ray, Rgb, Vec2, Vec3, luminance};
use crate::sampler::LightU;
use area::AreaLights;
use emission::Sphere;
use many::ManyLights;
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
    /// Index of the light: emissive triangles first, then lights without area, then the environment.
    pub light: u32,
    /// Probability of the choice of the light.
    pub pmf: f32,
}

/// Density of a [`LightSample`], in the measure of its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightDensity {
    /// Density per steradian, for area lights and the environment.
    SolidAngle(f32),
    /// For lights that no BSDF sample can hit: the probability of the choice of a light without area, or the density
    /// per steradian of an invisible lamp.
    Delta(f32),
}

impl LightDensity {
    /// The divisor of a sample's contribution: `pdf_w` or `pmf`.
    #[inline]
    pub fn value(self) -> f32 {
        match self {
            Self::SolidAngle(pdf_w) => pdf_w,
            Self::Delta(pmf) => pmf,
        }
    }

    /// True for lights that no BSDF sample can hit.
    #[inline]
    pub(crate) fn is_delta(self) -> bool {
        matches!(self, Self::Delta(_))
    }

    /// MIS weight of the light sample against BSDF samples of density `pdf_w` per steradian (balance heuristic); 1 for
    /// [`LightDensity::Delta`].
    #[inline]
    pub fn mis_weight(self, pdf_w: f32) -> f32 {
        match self {
            Self::SolidAngle(light) => balance(light, pdf_w),
            Self::Delta(_) => 1.0,
        }
    }
}

/// A point of a light, or the direction of a light at infinity, drawn as the end of manifold chains.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPoint {
    light: usize,
    pmf: f32,
    at: Vec2,
    pub(crate) place: Location,
}

/// Place of a [`LightPoint`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Location {
    /// World position.
    Point(Vec3),
    /// Unit direction towards a light at infinity.
    Direction(Vec3),
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

/// Warning of a scene without light.
pub(super) const BLACK: &str = "no light: the picture will be black";

/// All lights of a scene and the distribution over them.
pub struct Lights {
    /// Choice by power: emissive triangles first, then lights without area, then the environment.
    choice: AliasTable,
    /// Choice at a point, in scenes of many lights.
    many: Option<ManyLights>,
    area: AreaLights,
    punctual: Vec<PunctualLight>,
    environment: Option<Environment>,
    environment_pmf: f32,
    /// The sphere round the scene, through which light from infinity enters.
    sphere: Sphere,
}

impl Lights {
    /// Collects the lights and builds the distributions over them.
    pub(crate) fn new(parts: &SceneParts, geometry: &Geometry, warnings: &mut Vec<String>) -> Self {
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
            warnings.push(BLACK.into());
            area = AreaLights::default();
        }
        area.set_densities(|k| choice.pmf(k));
        let environment_pmf = match &parts.environment {
            Some(_) if !choice.is_empty() => choice.pmf(powers.len() - 1),
            _ => 0.0,
        };
        let many = (!choice.is_empty())
            .then(|| ManyLights::new(&area, &parts.lights, geometry, &powers, disk))
            .flatten();
        if many.is_some() {
            area.index();
        }
        Self {
            choice,
            many,
            area,
            punctual: parts.lights.clone(),
            environment: parts.environment.clone(),
            environment_pmf,
            sphere: Sphere::around(geometry.bounds()),
        }
    }

    /// Builds the index that the densities of [aimed](Aim) lights need.
    pub(crate) fn index(&self) {
        self.area.index();
    }

    /// Index of an emissive triangle among the lights, once they are [indexed](Lights::index).
    #[cfg(test)]
    pub(crate) fn light_of(&self, surface: &crate::scene::Surface) -> Option<usize> {
        self.area.place(surface.triangle)
    }

    /// Number of lights: emissive triangles first, then lights without area, then the environment.
    pub(crate) fn len(&self) -> usize {
        self.area.len() + self.punctual.len() + usize::from(self.environment.is_some())
    }

    /// Radius of the sphere round the scene, through which light from infinity enters.
    pub(crate) fn reach(&self) -> f32 {
        self.sphere.radius()
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
    pub fn sample(&self, from: Vec3, u: LightU) -> Option<LightSample> {
        let (k, pmf, rest) = self.sample_light(from, u.pick)?;
        self.sample_one(k, pmf, from, u.at, rest)
    }

    /// Draws the light that [`Lights::sample`] draws: its index as in [`Lights::pmf`], the probability of the choice,
    /// and the remainder of `pick`, uniform in [0, 1) again.
    #[inline]
    pub(crate) fn sample_light(&self, from: Vec3, pick: f64) -> Option<(usize, f32, f64)> {
        match &self.many {
            None => {
                let (k, rest) = self.choice.sample(pick)?;
                Some((k, self.choice.pmf(k), rest))
            }
            Some(many) => Some(many.sample(from, pick)).filter(|(_, pmf, _)| *pmf > 0.0),
        }
    }

    /// Draws a point on the `k`-th light, which was chosen with this probability; `further` in [0, 1) refines `at`.
    #[inline]
    fn sample_one(
        &self,
        k: usize,
        pmf: f32,
        from: Vec3,
        at: Vec2,
        further: f64,
    ) -> Option<LightSample> {
        let Some(rest) = k.checked_sub(self.area.len()) else {
            return self.area.sample(k, pmf, from, at);
        };
        if let Some(light) = self.punctual.get(rest) {
            return light.illuminate(k, from, pmf);
        }
        let at = refined(at, further);
        let (wi, radiance, pdf_w) = self.environment.as_ref()?.sample(at)?;
        Some(LightSample {
            wi,
            distance: f32::INFINITY,
            radiance,
            density: LightDensity::SolidAngle(pdf_w * pmf),
            cos: 1.0,
            error: 0.0,
            light: k as u32,
            pmf,
        })
    }

    /// Draws a light by power with `pick` and a point on it; `None` for the environment.
    pub(crate) fn end(&self, pick: f64, at: Vec2) -> Option<LightPoint> {
        let (light, _) = self.choice.sample(pick)?;
        let place = match light.checked_sub(self.area.len()) {
            None => Location::Point(self.area.position(light, at)),
            Some(rest) => self.punctual.get(rest)?.place(),
        };
        Some(LightPoint {
            light,
            pmf: self.choice.pmf(light),
            at,
            place,
        })
    }

    /// The light sample from `from` to this end; `None` if the light does not reach `from`. Visibility is not tested.
    pub(crate) fn sample_end(&self, from: Vec3, end: &LightPoint) -> Option<LightSample> {
        self.sample_one(end.light, end.pmf, from, end.at, 0.0)
    }

    /// Radiance emitted by a surface point towards `wo` (world); zero for most surfaces and for sides that do not emit.
    #[inline]
    pub fn emitted(&self, surface: &Surface, wo: Vec3) -> Rgb {
        self.area.emitted(surface, wo)
    }

    /// Density per steradian with which [`Lights::sample`] from `from` draws the direction to that emitting point.
    #[inline]
    pub(crate) fn pdf_emitter(&self, from: Vec3, surface: &Surface) -> f32 {
        AreaLights::pdf(self.pdf_a_emitter(from, surface), from, surface)
    }

    /// [`Lights::pdf_emitter`] per area.
    #[inline]
    pub(crate) fn pdf_a_emitter(&self, from: Vec3, surface: &Surface) -> f32 {
        match &self.many {
            None => self.area.pdf_by_power(surface.triangle),
            Some(many) => (self.area.place(surface.triangle))
                .map_or(0.0, |k| many.pmf(k, from) * self.area.pdf_point(k)),
        }
    }

    /// Radiance seen from the scene when looking along `dir` past all surfaces.
    #[inline]
    pub fn environment(&self, dir: Vec3) -> Rgb {
        (self.environment.as_ref()).map_or(Rgb::ZERO, |e| e.radiance(dir))
    }

    /// Density per steradian with which [`Lights::sample`] from `from` draws the direction `dir` of the environment.
    #[inline]
    pub(crate) fn pdf_environment(&self, from: Vec3, dir: Vec3) -> f32 {
        let Some(environment) = &self.environment else {
            return 0.0;
        };
        let pmf = match &self.many {
            None => self.environment_pmf,
            Some(many) => many.pmf(self.area.len() + self.punctual.len(), from),
        };
        environment.pdf(dir) * pmf
    }

    /// Probability with which [`Lights::sample`] from `from` draws the light with this index: emissive triangles first,
    /// then lights without area, then the environment.
    #[cfg(test)]
    pub(crate) fn pmf(&self, light: usize, from: Vec3) -> f32 {
        match &self.many {
            None => self.choice.pmf(light),
            Some(many) => many.pmf(light, from),
        }
    }

    /// Probability of this light by power alone, without a lit point, as emission sampling draws it.
    pub(crate) fn emission_pmf(&self, light: usize) -> f32 {
        self.choice.pmf(light)
    }

    /// The closest emissive triangle along a ray. Most rays hit none and need not traverse the rest of the scene.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.area.closest(ray)
    }
}

/// Coordinates of 24 bits each with further bits from `u`, all in [0, 1).
#[inline]
fn refined(at: Vec2, u: f64) -> DVec2 {
    let x = u * f64::from(1 << 26);
    let further = DVec2::new(x.floor() / f64::from(1 << 26), x.fract());
    at.as_dvec2() + further / f64::from(1 << 24)
}
