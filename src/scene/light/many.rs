//! Choice among many lights at a point: a light tree over those at finite distance, and a table of those at infinity.

use super::area::AreaLights;
use super::punctual::PunctualLight;
use super::tree::{Item, LightBounds, LightTree};
use crate::math::discrete::AliasTable;
use crate::math::{Vec3, luminance};
use crate::scene::Geometry;
use std::f32::consts::PI;

/// Largest number of lights at finite distance that are drawn by power alone: so few need no tree, and pictures of
/// simple scenes do not depend on one.
const FEW: usize = 8;

/// Least and largest probability of the lights at infinity, if there are others: the bounds ignore occlusion, such as
/// of the sun outside a room.
const INFINITE: [f64; 2] = [0.1, 0.75];

/// Distribution over the lights of a scene that depends on the point they light.
pub(super) struct ManyLights {
    tree: LightTree,
    /// Directional lights and the environment, by power, and their indices among all lights.
    infinite: AliasTable,
    infinite_lights: Vec<u32>,
    /// Irradiance of the lights at infinity on a plane that faces them, in the unit of the tree.
    irradiance: f32,
}

impl ManyLights {
    /// `None` if few lights are at finite distance. `powers` are those of all lights: emissive triangles, lights
    /// without area, the environment; light at infinity enters through the area `disk`.
    pub(super) fn new(
        area: &AreaLights,
        punctual: &[PunctualLight],
        geometry: &Geometry,
        powers: &[f64],
        disk: f64,
    ) -> Option<Self> {
        // Intensities are relative, so that they stay within the range of single precision.
        let unit = 1.0 / powers.iter().sum::<f64>();
        let mut meshes = area.bounds(geometry, unit);
        let mut infinite_lights = Vec::new();
        for (i, &power) in powers.iter().enumerate().skip(area.len()) {
            let light = punctual.get(i - area.len());
            match light.map(|light| light.bounds(unit)) {
                Some(Some(bounds)) if power > 0.0 => meshes.push(Item::light(bounds, i)),
                Some(Some(_)) => {}
                _ => infinite_lights.push(i as u32),
            }
        }
        if meshes.iter().map(Item::lights).sum::<usize>() <= FEW {
            return None;
        }
        let at_infinity: Vec<f64> = (infinite_lights.iter())
            .map(|&i| powers[i as usize])
            .collect();
        Some(Self {
            tree: LightTree::new(meshes, powers.len()),
            infinite: AliasTable::new(&at_infinity),
            infinite_lights,
            irradiance: (at_infinity.iter().sum::<f64>() * unit / disk) as f32,
        })
    }

    /// Probability of the lights at infinity together: their share of the irradiance that may arrive at the point.
    #[inline]
    fn at_infinity(&self, from: Vec3) -> f64 {
        if self.infinite.is_empty() {
            return 0.0;
        }
        let tree = f64::from(self.tree.irradiance(from));
        let [least, most] = INFINITE;
        // `max` replaces the NaN of 0/0 by the least.
        let share = f64::from(self.irradiance) / (f64::from(self.irradiance) + tree);
        share.max(least).min(most)
    }

    /// Maps `u` in [0, 1) to a light, with the probability of the choice and the remainder of `u`.
    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: f64) -> (usize, f32, f64) {
        let p = self.at_infinity(from);
        if u < p
            && let Some((k, rest)) = self.infinite.sample(u / p)
        {
            let pmf = p * f64::from(self.infinite.pmf(k));
            return (self.infinite_lights[k] as usize, pmf as f32, rest);
        }
        let (k, pmf, rest) = self.tree.sample(from, (u - p) / (1.0 - p));
        (k, (pmf * (1.0 - p)) as f32, rest)
    }

    /// Probability with which [`ManyLights::sample`] draws a light.
    #[inline]
    pub(super) fn pmf(&self, light: usize, from: Vec3) -> f32 {
        let p = self.at_infinity(from);
        let pmf = match self.infinite_lights.binary_search(&(light as u32)) {
            Ok(k) if p > 0.0 => p * f64::from(self.infinite.pmf(k)),
            Ok(_) => 0.0,
            Err(_) => (1.0 - p) * self.tree.pmf(light, from),
        };
        pmf as f32
    }
}

impl PunctualLight {
    /// Bounds for the tree, with intensities multiplied by `unit`; `None` for a light at infinity.
    fn bounds(&self, unit: f64) -> Option<LightBounds> {
        let at = |position: Vec3, axis, cos_facing, cos_emission, intensity| LightBounds {
            low: position,
            high: position,
            axis,
            cos_facing,
            cos_emission,
            two_sided: false,
            intensity: (f64::from(luminance(intensity)).max(0.0) * unit) as f32,
        };
        match *self {
            Self::Directional { .. } => None,
            Self::Point {
                position,
                intensity,
                ..
            } => Some(at(position, Vec3::Y, -1.0, 0.0, intensity)),
            Self::Spot {
                position,
                direction,
                intensity,
                cos_inner,
                cos_outer,
                ..
            } => {
                // Full intensity up to the inner angle, none beyond the outer.
                let ramp = cos_outer.acos() - cos_inner.acos();
                let cos_emission = ramp.clamp(0.0, 0.5 * PI).cos();
                Some(at(position, direction, cos_inner, cos_emission, intensity))
            }
        }
    }
}
