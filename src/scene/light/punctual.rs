//! Lights without area: point, spot and directional lights.

use super::{LightDensity, LightSample};
use crate::math::{Rgb, Vec3, luminance};
use std::f32::consts::PI;

/// A light without area (`KHR_lights_punctual`), in world space.
#[derive(Clone, Copy, Debug)]
pub enum PunctualLight {
    /// Shines in all directions.
    Point {
        /// Position in world space.
        position: Vec3,
        /// Radiant intensity in W/sr (a file's candela are taken as W/sr).
        intensity: Rgb,
        /// Cutoff distance, infinity for none.
        range: f32,
    },
    /// Shines into a cone.
    Spot {
        /// Position in world space.
        position: Vec3,
        /// Unit axis, away from the light.
        direction: Vec3,
        /// Radiant intensity on the axis.
        intensity: Rgb,
        /// Cutoff distance, infinity for none.
        range: f32,
        /// Cosine of the angle at which the fall-off begins.
        cos_inner: f32,
        /// Cosine of the angle at which the fall-off ends.
        cos_outer: f32,
    },
    /// Shines along one direction from infinity.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a plane facing the light.
        irradiance: Rgb,
    },
}

impl PunctualLight {
    /// Emitted power (luminance), to choose among lights; light from infinity enters through the area `disk`.
    pub(super) fn power(&self, disk: f64) -> f64 {
        let power = |c: Rgb| f64::from(luminance(c)).max(0.0);
        match *self {
            Self::Point { intensity, .. } => power(intensity) * 4.0 * f64::from(PI),
            Self::Spot {
                intensity,
                cos_inner,
                cos_outer,
                ..
            } => {
                let cos = 0.5 * f64::from(cos_inner + cos_outer);
                power(intensity) * 2.0 * f64::from(PI) * (1.0 - cos).max(1e-6)
            }
            Self::Directional { irradiance, .. } => power(irradiance) * disk,
        }
    }

    /// Light that arrives at a point; `pmf` is the probability with which this light was chosen.
    #[inline]
    pub(super) fn illuminate(&self, from: Vec3, pmf: f32) -> Option<LightSample> {
        let (wi, distance, radiance) = match *self {
            Self::Directional {
                direction,
                irradiance,
            } => (-direction, f32::INFINITY, irradiance),
            Self::Point {
                position,
                intensity,
                range,
            } => {
                let (wi, distance, falloff) = attenuate(from, position, range)?;
                (wi, distance, intensity * falloff)
            }
            Self::Spot {
                position,
                direction,
                intensity,
                range,
                cos_inner,
                cos_outer,
            } => {
                let (wi, distance, falloff) = attenuate(from, position, range)?;
                // Recommended fall-off of [glTF] KHR_lights_punctual: a squared ramp between the two angles.
                let ramp = (-wi.dot(direction) - cos_outer) / (cos_inner - cos_outer).max(1e-4);
                let ramp = ramp.clamp(0.0, 1.0);
                (wi, distance, intensity * (falloff * ramp * ramp))
            }
        };
        (radiance != Rgb::ZERO).then_some(LightSample {
            wi,
            distance,
            radiance,
            density: LightDensity::Delta(pmf),
            cos: 1.0,
            // At infinity the ray must not end before it.
            error: if distance.is_finite() {
                2.0 * f32::EPSILON * distance
            } else {
                0.0
            },
            emission_ratio: 1.0,
        })
    }
}

/// Direction and distance to a light without area, and its inverse-square fall-off with the cutoff of [glTF]:
/// max(min(1 − (d/range)⁴, 1), 0)/d².
#[inline]
fn attenuate(from: Vec3, position: Vec3, range: f32) -> Option<(Vec3, f32, f32)> {
    let to = position - from;
    let distance = to.length();
    let window = (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0);
    let falloff = window / (distance * distance);
    (falloff > 0.0 && falloff.is_finite()).then(|| (to / distance, distance, falloff))
}
