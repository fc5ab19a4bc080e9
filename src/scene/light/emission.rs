//! Light paths: rays on which the lights shine, each beside the densities it is drawn with.
//!
//! A light is drawn from the distribution of light sampling, so that the probability of the choice is the same in both.

use super::{Lights, punctual};
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3, warp};
use crate::scene::{Scene, Surface};
use std::f32::consts::{FRAC_1_PI, PI};

/// Densities of an emission sample, choice of the light included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionDensity {
    /// Density of the starting point: per area of an area light; per area across the ray for a light at infinity; the
    /// probability of the choice for a point or spot light.
    pub position: f32,
    /// Density of the direction per steradian; the probability of the choice for a directional light.
    pub direction: f32,
    /// True for directional lights and the environment.
    pub infinite: bool,
}

/// A ray on which a light shines.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// The ray, clear of the light's own surface.
    pub ray: Ray,
    /// Radiance times cosine, intensity or irradiance over the densities: flux of the light path.
    pub throughput: Rgb,
    /// Its densities.
    pub pdf: EmissionDensity,
    /// Absolute cosine at the light's surface, 1 for the environment; 0 for lights that no ray can meet.
    pub cos: f32,
    /// Cutoff distance of a point or spot light, infinity for none.
    pub range: f32,
}

impl EmissionSample {
    /// Factor of the throughput at this distance: the window with which `[glTF]` ends a light of limited range.
    #[inline]
    pub fn window(&self, distance: f32) -> f32 {
        punctual::window(distance, self.range)
    }
}

/// The sphere round the scene, through which light from infinity enters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    centre: Vec3,
    radius: f32,
}

impl Sphere {
    pub(super) fn around((low, high): (Vec3, Vec3)) -> Self {
        Self {
            centre: 0.5 * (low + high),
            radius: 0.5 * low.distance(high),
        }
    }

    /// Density per area of a point of the sphere's disk across a direction.
    #[inline]
    pub(super) fn pdf(&self) -> f32 {
        1.0 / (PI * self.radius * self.radius)
    }

    /// A ray along `dir` from before the scene, through a uniform point of the disk across it.
    pub(super) fn ray(&self, dir: Vec3, u: Vec2) -> Ray {
        let p = self.radius * warp::disk(u);
        let across = Frame::from_normal(dir).to_world(Vec3::new(p.x, p.y, -self.radius));
        Ray::new(self.centre + across, dir)
    }
}

impl Lights {
    /// Densities with which an emission sample starts at that emitting point and leaves along `wo` (world).
    #[inline]
    pub fn pdf_emission(&self, surface: &Surface, wo: Vec3) -> EmissionDensity {
        let (position, direction) = self.area.emission_density(surface, wo);
        EmissionDensity {
            position,
            direction,
            infinite: false,
        }
    }

    /// Densities with which an emission sample comes from the environment seen along `dir`.
    #[inline]
    pub fn pdf_emission_environment(&self, dir: Vec3) -> EmissionDensity {
        EmissionDensity {
            position: self.sphere.pdf(),
            direction: (self.environment.as_ref())
                .map_or(0.0, |e| e.pdf(dir) * self.environment_pmf),
            infinite: true,
        }
    }
}

impl Scene {
    /// Draws a light by power with `pick`, then a point of it and a direction with five more uniform numbers in [0, 1). `None` where nothing
    /// shines: without lights, and for a draw that carries no light.
    pub fn sample_emission(&self, pick: f64, u: [f32; 5]) -> Option<EmissionSample> {
        let lights = &self.lights;
        let (k, _) = lights.choice.sample(pick)?;
        let (point, direction) = (Vec2::new(u[0], u[1]), Vec2::new(u[2], u[3]));
        let sample = match k.checked_sub(lights.area.len()) {
            None => self.emission_of_triangle(k, point, direction, u[4])?,
            Some(rest) => {
                let pmf = lights.choice.pmf(k);
                match lights.punctual.get(rest) {
                    Some(light) => light.emit(pmf, &lights.sphere, point, direction)?,
                    None => {
                        let environment = lights.environment.as_ref()?;
                        let (towards, radiance, pdf_w) =
                            environment.sample(direction.as_dvec2())?;
                        let pdf = EmissionDensity {
                            position: lights.sphere.pdf(),
                            direction: pmf * pdf_w,
                            infinite: true,
                        };
                        EmissionSample {
                            ray: lights.sphere.ray(-towards, point),
                            throughput: radiance / (pdf.position * pdf.direction),
                            pdf,
                            cos: 1.0,
                            range: f32::INFINITY,
                        }
                    }
                }
            }
        };
        (sample.throughput != Rgb::ZERO && sample.pdf.position.is_finite()).then_some(sample)
    }

    fn emission_of_triangle(
        &self,
        k: usize,
        point: Vec2,
        direction: Vec2,
        side: f32,
    ) -> Option<EmissionSample> {
        let area = &self.lights.area;
        let surface = self.surface(&area.point(k, point));
        let (radiance, double_sided) = area.exitance(&surface);
        let mut local = warp::cosine_hemisphere(direction);
        let cos = local.z;
        if double_sided && side < 0.5 {
            local.z = -local.z;
        }
        let dir = Frame::from_normal(surface.ng).to_world(local);
        let sides = if double_sided { 2.0 } else { 1.0 };
        let pdf = EmissionDensity {
            position: area.emission_density(&surface, dir).0,
            direction: cos * FRAC_1_PI / sides,
            infinite: false,
        };
        (cos > 0.0).then(|| EmissionSample {
            ray: surface.spawn(dir),
            throughput: radiance * (PI * sides / pdf.position),
            pdf,
            cos,
            range: f32::INFINITY,
        })
    }
}
