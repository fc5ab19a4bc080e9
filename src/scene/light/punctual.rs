//! Lights without area: point, spot and directional lights.

use super::aim::{AimShares, Source};
use super::emission::{EmissionDensity, EmissionSample, Sphere};
use super::{LightDensity, LightSample, Location};
use crate::math::warp::{self, SPHERE_PDF};
use crate::math::{Frame, Ray, Rgb, Vec3, luminance};
use crate::sampler::EmissionU;
use std::f32::consts::{PI, TAU};

/// Fall-off of a spot light between its two angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Falloff {
    /// The square of a ramp in the cosine, which glTF recommends.
    #[default]
    Squared,
    /// A cubic in the cosine, smooth at both ends `[PBRT4 §12.2.1]`.
    Smooth,
    /// A ramp in the angle.
    Linear,
}

impl Falloff {
    /// Factor of the intensity at this cosine with the axis, in [0, 1].
    #[inline]
    fn at(self, cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
        let ramp = ramp(cos, cos_inner, cos_outer);
        match self {
            Self::Squared => ramp * ramp,
            Self::Smooth => ramp * ramp * (3.0 - 2.0 * ramp),
            Self::Linear => {
                let angle = |cos: f32| cos.clamp(-1.0, 1.0).acos();
                let (inner, outer) = (angle(cos_inner), angle(cos_outer));
                ((outer - angle(cos)) / (outer - inner).max(1e-4)).clamp(0.0, 1.0)
            }
        }
    }
}

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
        /// Fall-off between the two.
        falloff: Falloff,
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

    pub(super) fn place(&self) -> Location {
        match *self {
            Self::Point { position, .. } | Self::Spot { position, .. } => Location::Point(position),
            Self::Directional { direction, .. } => Location::Direction(-direction),
        }
    }

    /// Light that arrives at a point from this light, the `k`-th of the scene, which was chosen with probability `pmf`.
    #[inline]
    pub(super) fn illuminate(&self, k: usize, from: Vec3, pmf: f32) -> Option<LightSample> {
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
                falloff: shape,
            } => {
                let (wi, distance, falloff) = attenuate(from, position, range)?;
                let ramp = shape.at(-wi.dot(direction), cos_inner, cos_outer);
                (wi, distance, intensity * (falloff * ramp))
            }
        };
        (radiance != Rgb::ZERO).then_some(LightSample {
            wi,
            distance,
            radiance,
            density: LightDensity::Delta(pmf),
            cos: 1.0,
            // At infinity the shadow ray must not end.
            error: if distance.is_finite() {
                2.0 * f32::EPSILON * distance
            } else {
                0.0
            },
            light: k as u32,
            pmf,
        })
    }

    /// Density with which an emission sample of this light draws a ray: per steradian, or for a light at infinity per
    /// area across it.
    #[inline]
    pub(super) fn pdf_ray(&self, sphere: &Sphere, beam: Option<&AimShares>, ray: &Ray) -> f32 {
        let uniform = match *self {
            Self::Directional { .. } => {
                let uniform = sphere.pdf();
                return beam.map_or(uniform, |beam| beam.pdf_across(ray, uniform));
            }
            Self::Point { .. } => SPHERE_PDF,
            Self::Spot { cos_outer, .. } => cone_pdf(cos_outer),
        };
        let source = Source {
            position: ray.origin,
            facing: None,
        };
        beam.map_or(uniform, |beam| beam.pdf_towards(&source, ray.dir, uniform))
    }

    /// Draws a ray of this light, with its densities; `pmf` is the probability with which the light was chosen,
    /// `sphere` the sphere round the scene.
    pub(super) fn emit(
        &self,
        pmf: f32,
        sphere: &Sphere,
        beam: Option<&AimShares>,
        u: &EmissionU,
    ) -> Option<EmissionSample> {
        let (position, dir, intensity, range) = match *self {
            Self::Directional {
                direction,
                irradiance,
            } => {
                let ray = sphere.ray(direction, beam, u);
                let pdf = EmissionDensity {
                    position: self.pdf_ray(sphere, beam, &ray),
                    direction: pmf,
                    infinite: true,
                };
                return Some(EmissionSample {
                    ray,
                    throughput: irradiance / (pmf * pdf.position),
                    pdf,
                    cos: 0.0,
                    range: f32::INFINITY,
                    light: 0,
                });
            }
            Self::Point {
                position,
                intensity,
                range,
            } => {
                let dir = aimed(beam, position, u).unwrap_or_else(|| warp::sphere(u.direction));
                (position, dir, intensity, range)
            }
            Self::Spot {
                position,
                direction: axis,
                intensity,
                range,
                cos_inner,
                cos_outer,
                falloff,
            } => {
                let width = 1.0 - cos_outer;
                let (dir, cos) = match aimed(beam, position, u) {
                    Some(dir) => (dir, dir.dot(axis)),
                    None => {
                        let local = warp::cone(u.direction, width);
                        (Frame::from_normal(axis).to_world(local), local.z)
                    }
                };
                let share = falloff.at(cos, cos_inner, cos_outer);
                let sends = width > 0.0;
                if !sends {
                    return None;
                }
                (position, dir, intensity * share, range)
            }
        };
        let ray = Ray::new(position, dir);
        let pdf_w = self.pdf_ray(sphere, beam, &ray);
        Some(EmissionSample {
            ray,
            throughput: intensity / (pmf * pdf_w),
            pdf: EmissionDensity {
                position: pmf,
                direction: pdf_w,
                infinite: false,
            },
            cos: 0.0,
            range,
            light: 0,
        })
    }
}

/// A direction from a point towards a target; `None` if uniform emission is chosen.
fn aimed(beam: Option<&AimShares>, position: Vec3, u: &EmissionU) -> Option<Vec3> {
    let source = Source {
        position,
        facing: None,
    };
    beam?.direction(&source, u.pick, u.direction)
}

/// A ramp in the cosine between the two angles.
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
