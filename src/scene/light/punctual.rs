//! Lights without area: point, spot and directional lights.

use super::emission::{EmissionDensity, EmissionSample, Sphere};
use super::{LightDensity, LightSample};
use crate::math::warp::{self, SPHERE_PDF};
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3, luminance};
use std::f32::consts::{PI, TAU};

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

    /// Light that arrives at a point; `pmf` is the probability with which this light was chosen, `disk_pdf` the density
    /// per area with which its emission sample starts if the light is at infinity.
    #[inline]
    pub(super) fn illuminate(&self, from: Vec3, pmf: f32, disk_pdf: f32) -> Option<LightSample> {
        let (wi, distance, radiance, emission_pdf) = match *self {
            Self::Directional {
                direction,
                irradiance,
            } => (-direction, f32::INFINITY, irradiance, disk_pdf),
            Self::Point {
                position,
                intensity,
                range,
            } => {
                let (wi, distance, falloff) = attenuate(from, position, range)?;
                (wi, distance, intensity * falloff, SPHERE_PDF)
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
                let ramp = ramp(-wi.dot(direction), cos_inner, cos_outer);
                let radiance = intensity * (falloff * ramp * ramp);
                (wi, distance, radiance, cone_pdf(cos_outer))
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
            emission_pdf,
        })
    }

    /// A ray on which this light shines, and the densities it is drawn with; `pmf` is the probability with which the
    /// light was chosen, `sphere` the sphere round the scene.
    pub(super) fn emit(
        &self,
        pmf: f32,
        sphere: &Sphere,
        point: Vec2,
        direction: Vec2,
    ) -> Option<EmissionSample> {
        let finite = |position, dir, intensity: Rgb, pdf_w: f32, range| EmissionSample {
            ray: Ray::new(position, dir),
            throughput: intensity / (pmf * pdf_w),
            pdf: EmissionDensity {
                position: pmf,
                direction: pdf_w,
                infinite: false,
            },
            cos: 0.0,
            range,
        };
        match *self {
            Self::Point {
                position,
                intensity,
                range,
            } => Some(finite(
                position,
                warp::sphere(direction),
                intensity,
                SPHERE_PDF,
                range,
            )),
            Self::Spot {
                position,
                direction: axis,
                intensity,
                range,
                cos_inner,
                cos_outer,
            } => {
                let width = 1.0 - cos_outer;
                let z = 1.0 - direction.x * width;
                let r = (direction.x * width * (2.0 - direction.x * width))
                    .max(0.0)
                    .sqrt();
                let (sin, cos) = (TAU * direction.y).sin_cos();
                let dir = Frame::from_normal(axis).to_world(Vec3::new(r * cos, r * sin, z));
                let ramp = ramp(z, cos_inner, cos_outer);
                (width > 0.0).then(|| {
                    let intensity = intensity * (ramp * ramp);
                    finite(position, dir, intensity, cone_pdf(cos_outer), range)
                })
            }
            Self::Directional {
                direction,
                irradiance,
            } => Some(EmissionSample {
                ray: sphere.ray(direction, point),
                throughput: irradiance / (pmf * sphere.pdf()),
                pdf: EmissionDensity {
                    position: sphere.pdf(),
                    direction: pmf,
                    infinite: true,
                },
                cos: 0.0,
                range: f32::INFINITY,
            }),
        }
    }
}

/// Recommended fall-off of [glTF] KHR_lights_punctual before it is squared: a ramp between the two angles.
#[inline]
fn ramp(cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    let ramp = (cos - cos_outer) / (cos_inner - cos_outer).max(1e-4);
    ramp.clamp(0.0, 1.0)
}

/// Density per steradian of a uniform direction in a cone.
#[inline]
fn cone_pdf(cos_outer: f32) -> f32 {
    1.0 / (TAU * (1.0 - cos_outer))
}

/// The window of [glTF] that ends a light of this range: max(min(1 − (d/range)⁴, 1), 0).
#[inline]
pub(in crate::scene) fn window(distance: f32, range: f32) -> f32 {
    (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0)
}

/// Direction and distance to a light without area, and its inverse-square fall-off with the cutoff of [glTF]:
/// max(min(1 − (d/range)⁴, 1), 0)/d².
#[inline]
fn attenuate(from: Vec3, position: Vec3, range: f32) -> Option<(Vec3, f32, f32)> {
    let to = position - from;
    let distance = to.length();
    let falloff = window(distance, range) / (distance * distance);
    (falloff > 0.0 && falloff.is_finite()).then(|| (to / distance, distance, falloff))
}
