//! Emission sampling: rays that start light paths, with their densities.
//!
//! A light is drawn by power, since the points that it will light are not known. Its point and direction are drawn
//! uniformly in its own measure, or aimed at targets (`aim`).

use super::aim::{Aim, AimShares, Source, Target};
use super::{LightSample, Lights, punctual};
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3, warp};
use crate::sampler::EmissionU;
use crate::scene::{Geometry, Scene, Surface};
use std::f32::consts::{FRAC_1_PI, PI};

/// Densities of an emission sample, choice of the light included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EmissionDensity {
    /// Density of the starting point: per area of an area light; per area across the ray for a light at infinity; the
    /// probability of the choice for a point or spot light.
    pub position: f32,
    /// Density of the direction per steradian; the probability of the choice for a directional light.
    pub direction: f32,
    /// True for directional lights and the environment.
    pub infinite: bool,
}

/// A ray of emitted light, which starts a light path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmissionSample {
    /// The ray, clear of the light's own surface.
    pub ray: Ray,
    /// Radiance times cosine, intensity or irradiance over the densities: flux of the light path.
    pub throughput: Rgb,
    /// Its densities.
    pub pdf: EmissionDensity,
    /// Absolute cosine at the light's surface, 1 for the environment; 0 for lights that no ray can hit.
    pub cos: f32,
    /// Cutoff distance of a point or spot light, infinity for none.
    pub range: f32,
    /// Index of the light, as in [`Lights::pmf`].
    pub light: u32,
}

impl EmissionSample {
    /// Factor of the throughput at this distance: the window with which `[glTF]` ends a light of limited range.
    #[inline]
    pub(crate) fn window(&self, distance: f32) -> f32 {
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

    pub(super) fn radius(&self) -> f32 {
        self.radius
    }

    /// Density per area of a point of the sphere's disk across a direction.
    #[inline]
    pub(super) fn pdf(&self) -> f32 {
        1.0 / (PI * self.radius * self.radius)
    }

    /// A ray along `dir` from outside the scene through a point of the disk across it, either uniform or of a target.
    pub(super) fn ray(&self, dir: Vec3, beam: Option<&AimShares>, u: &EmissionU) -> Ray {
        if let Some(point) = beam.and_then(|beam| beam.point_across(dir, u.pick, u.point)) {
            let across = point - self.centre;
            let across = across - (across.dot(dir) + self.radius) * dir;
            return Ray::new(self.centre + across, dir);
        }
        let p = self.radius * warp::disk(u.point);
        let across = Frame::from_normal(dir).to_world(Vec3::new(p.x, p.y, -self.radius));
        Ray::new(self.centre + across, dir)
    }
}

impl Lights {
    /// Densities with which an emission sample starts at that emitting point and leaves along `wo` (world).
    #[inline]
    pub(crate) fn pdf_emission(&self, aim: &Aim, surface: &Surface, wo: Vec3) -> EmissionDensity {
        let beam = if aim.is_uniform() {
            None
        } else {
            (self.area.place(surface.triangle)).and_then(|k| aim.beam(k))
        };
        EmissionDensity {
            position: self.area.pdf_by_power(surface.triangle),
            direction: self.area.pdf_emission(beam, surface, wo),
            infinite: false,
        }
    }

    /// Densities with which an emission sample comes from the environment seen along a ray.
    #[inline]
    pub(crate) fn pdf_emission_environment(&self, aim: &Aim, ray: &Ray) -> EmissionDensity {
        let beam = aim.beam(self.area.len() + self.punctual.len());
        EmissionDensity {
            position: self.pdf_across(beam, ray),
            direction: (self.environment.as_ref())
                .map_or(0.0, |e| e.pdf(ray.dir) * self.environment_pmf),
            infinite: true,
        }
    }

    /// Density per area across a ray of emission samples from infinity.
    #[inline]
    fn pdf_across(&self, beam: Option<&AimShares>, ray: &Ray) -> f32 {
        let uniform = self.sphere.pdf();
        beam.map_or(uniform, |beam| beam.pdf_across(ray, uniform))
    }

    /// Density with which an emission sample starts at the point of a light sample and reaches the point `from` that it
    /// was drawn for, over the density with which light sampling draws that point: per steradian, or for a light at
    /// infinity per area across.
    #[inline]
    pub(crate) fn emission_over_sampling(&self, aim: &Aim, light: &LightSample, from: Vec3) -> f32 {
        let k = light.light as usize;
        let beam = aim.beam(k);
        let pdf = match k.checked_sub(self.area.len()) {
            None => self.area.pdf_emission_to(beam, light, from),
            Some(rest) => match self.punctual.get(rest) {
                Some(punctual) => {
                    let start = if light.distance.is_finite() {
                        from + light.distance * light.wi
                    } else {
                        from
                    };
                    punctual.pdf_ray(&self.sphere, beam, &Ray::new(start, -light.wi))
                }
                None => self.pdf_across(beam, &Ray::new(from, light.wi)),
            },
        };
        match self.many {
            None => pdf,
            Some(_) => pdf * (self.emission_pmf(k) / light.pmf),
        }
    }

    /// Densities of an emission sample's ray by uniform emission and by each target: per area across the ray for light
    /// at infinity, per steradian otherwise.
    pub(crate) fn pdf_parts(&self, start: &EmissionSample, targets: &[Target]) -> (f32, Vec<f32>) {
        let k = start.light as usize;
        if start.pdf.infinite {
            let part = |target: &Target| target.pdf_across(&start.ray);
            return (self.sphere.pdf(), targets.iter().map(part).collect());
        }
        let source = Source {
            position: start.ray.origin,
            facing: None,
        };
        let uniform = match k.checked_sub(self.area.len()) {
            None => self.area.pdf_uniform(k, start.cos, start.ray.dir),
            Some(rest) => self.punctual[rest].pdf_ray(&self.sphere, None, &start.ray),
        };
        let part = |target: &Target| {
            target
                .pdf_towards(&source, start.ray.dir)
                .unwrap_or(uniform)
        };
        (uniform, targets.iter().map(part).collect())
    }

    /// For each light, its group of lights that may share a beam: area lights by mesh, each light without area, the
    /// environment. There are at most `most` groups, which is at least 3.
    pub(crate) fn groups(&self, geometry: &Geometry, most: u8) -> Vec<u8> {
        let mut groups = Vec::with_capacity(self.len());
        let (mut group, mut last) = (0, None);
        let next = |group: u8, limit: u8| (group + 1).min(limit - 1);
        for k in 0..self.area.len() {
            let mesh = geometry.triangle_mesh(self.area.point(k, Vec2::ZERO).triangle);
            if last.is_some_and(|last| last != mesh) {
                group = next(group, most / 2);
            }
            last = Some(mesh);
            groups.push(group);
        }
        let mut any = last.is_some();
        for _ in self.area.len()..self.len() {
            if any {
                group = next(group, most);
            }
            any = true;
            groups.push(group);
        }
        groups
    }

    /// Probability with which light sampling from `from` draws a light, over that of emission sampling.
    #[inline]
    pub(crate) fn sampling_over_emission(&self, light: u32, from: Vec3) -> f32 {
        match &self.many {
            None => 1.0,
            Some(many) => many.pmf(light as usize, from) / self.emission_pmf(light as usize),
        }
    }
}

impl Scene {
    /// Draws a light by power, then a point of it and a direction, aimed or not. `None` without lights, and for a draw
    /// that carries no light.
    pub(crate) fn sample_emission(&self, aim: &Aim, u: EmissionU) -> Option<EmissionSample> {
        let lights = &self.lights;
        let (k, rest) = lights.choice.sample(u.pick)?;
        // The rest of the number chooses a target.
        let u = EmissionU { pick: rest, ..u };
        let (beam, pmf) = (aim.beam(k), lights.choice.pmf(k));
        let sample = match k.checked_sub(lights.area.len()) {
            None => self.emission_of_triangle(k, beam, &u)?,
            Some(rest) => match lights.punctual.get(rest) {
                Some(light) => light.emit(pmf, &lights.sphere, beam, &u)?,
                None => self.emission_of_environment(pmf, beam, &u)?,
            },
        };
        let sample = EmissionSample {
            light: k as u32,
            ..sample
        };
        (sample.throughput != Rgb::ZERO && sample.pdf.position.is_finite()).then_some(sample)
    }

    fn emission_of_environment(
        &self,
        pmf: f32,
        beam: Option<&AimShares>,
        u: &EmissionU,
    ) -> Option<EmissionSample> {
        let lights = &self.lights;
        let environment = lights.environment.as_ref()?;
        let (towards, radiance, pdf_w) = environment.sample(u.direction.as_dvec2())?;
        let ray = lights.sphere.ray(-towards, beam, u);
        let pdf = EmissionDensity {
            position: lights.pdf_across(beam, &ray),
            direction: pmf * pdf_w,
            infinite: true,
        };
        Some(EmissionSample {
            ray,
            throughput: radiance / (pdf.position * pdf.direction),
            pdf,
            cos: 1.0,
            range: f32::INFINITY,
            light: 0,
        })
    }

    fn emission_of_triangle(
        &self,
        k: usize,
        beam: Option<&AimShares>,
        u: &EmissionU,
    ) -> Option<EmissionSample> {
        let area = &self.lights.area;
        let surface = self.surface(&area.point(k, u.point));
        let (radiance, double_sided) = area.exitance(&surface);
        let source = Source {
            position: surface.position,
            facing: (!double_sided).then_some(surface.ng),
        };
        let aimed = beam.and_then(|beam| beam.direction(&source, u.pick, u.direction));
        let (dir, cos) = match aimed {
            Some(dir) => (dir, dir.dot(surface.ng)),
            None => {
                let mut local = warp::cosine_hemisphere(u.direction);
                let cos = local.z;
                if double_sided && u.side < 0.5 {
                    local.z = -local.z;
                }
                (Frame::from_normal(surface.ng).to_world(local), cos)
            }
        };
        let dark = cos <= 0.0 && !(double_sided && cos < 0.0);
        let position = area.pdf_by_power(surface.triangle);
        let sides = if double_sided { 2.0 } else { 1.0 };
        let cos = cos.abs();
        let direction = match beam {
            None => cos * FRAC_1_PI / sides,
            Some(_) => area.pdf_emission(beam, &surface, dir),
        };
        let scale = match beam {
            None => PI * sides / position,
            Some(_) => cos / (position * direction),
        };
        (!dark).then(|| EmissionSample {
            ray: surface.spawn(dir),
            throughput: radiance * (scale * area.share(&surface, dir)),
            pdf: EmissionDensity {
                position,
                direction,
                infinite: false,
            },
            cos: if area.shows_front(&surface) { cos } else { 0.0 },
            range: f32::INFINITY,
            light: 0,
        })
    }
}
