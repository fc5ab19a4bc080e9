//! One walk, from the camera or from a light: edges, vertices, draws, and the running numbers of the weights.

use super::vertex::{Origin, Vertex};
use super::weights::{Merging, Partial, Step, clamped};
use crate::bsdf::{BsdfSample, Lobe};
use crate::integrator::walk::bodies::EnclosingBodies;
use crate::integrator::walk::roulette;
use crate::math::{Ray, Rgb, Vec3};
use crate::scene::{EmissionDensity, EmissionSample, Hit, Scene};

/// A walk on its way to its next vertex.
pub(super) struct Walk<'a> {
    pub(super) scene: &'a Scene,
    pub(super) origin: Origin,
    pub(super) ray: Ray,
    pub(super) throughput: Rgb,
    pub(super) partial: Partial<f32>,
    pub(super) merging: Merging<f32>,
    /// True on an edge whose length changes no density: the first from a light at infinity or of a parallel camera.
    pub(super) parallel: bool,
    /// Factor that undoes all scaling that is no loss of light, for roulette.
    pub(super) roulette_scale: f32,
    pub(super) bodies: EnclosingBodies,
}

impl<'a> Walk<'a> {
    /// A walk along a ray that a light sends out.
    pub(super) fn light(scene: &'a Scene, start: &EmissionSample, merging: Merging<f32>) -> Self {
        let EmissionDensity {
            position,
            direction,
            infinite,
        } = start.pdf;
        Self {
            scene,
            origin: Origin::Light,
            ray: start.ray,
            throughput: start.throughput,
            partial: Partial::light(position, direction, infinite, start.cos, &merging),
            merging,
            parallel: infinite,
            roulette_scale: 1.0 / start.throughput.max_element(),
            bodies: if scene.tracks_bodies() && !infinite {
                EnclosingBodies::around(scene, &start.ray)
            } else {
                EnclosingBodies::default()
            },
        }
    }

    /// The surface at which the current edge ends, at its distance `t`, and the distance of the last boundary passed.
    #[inline]
    pub(super) fn arrive(&mut self) -> Option<(Hit, f32)> {
        let segment = self.bodies.follow(self.scene, &self.ray);
        if let Some(passed) = segment.passed {
            self.throughput *= passed;
        }
        Some((segment.hit?, segment.start))
    }

    /// The walk's `n`th vertex, where it has [arrived](Walk::arrive); `u` chooses between the BSDFs of its material.
    #[inline]
    pub(super) fn vertex(&mut self, n: u32, (hit, start): &(Hit, f32), u: f32) -> Vertex {
        let mut surface = self.scene.surface(hit);
        if !self.bodies.is_empty() {
            self.throughput *= self.bodies.transmittance(self.scene, hit.t - start);
        }
        let back = -self.ray.dir;
        let cos = clamped(surface.ng.dot(back));
        let distance2 = (!self.parallel).then_some(hit.t * hit.t);
        self.partial.arrive(distance2, cos);
        let throughput = match self.origin {
            Origin::Camera => self.throughput,
            Origin::Light => self.throughput / cos,
        };
        let mut bsdf = self.scene.bsdf(&mut surface, u);
        (self.bodies).interface(self.scene, &mut surface, self.ray.dir, &mut bsdf);
        let frame = surface.frame_for(back);
        Vertex {
            n,
            hit: *hit,
            choice: u,
            surface,
            bsdf,
            alpha: bsdf.alpha(),
            back,
            frame,
            local: frame.to_local(back),
            throughput,
            partial: self.partial,
            bodies: self.bodies,
        }
    }

    /// Draws the next direction at a vertex. True if a smooth lobe was drawn, `None` where the walk ends.
    #[inline]
    pub(super) fn scatter(&mut self, vertex: &Vertex, u: [f32; 3]) -> Option<bool> {
        let sample = vertex.bsdf.sample(vertex.alpha, vertex.local, u)?;
        let out = vertex.frame.to_world(sample.wi);
        if out.dot(vertex.surface.ng) * sample.wi.z <= 0.0 {
            return None;
        }
        if sample.delta {
            self.dirac(vertex, &sample, out)?;
        } else {
            let cos_out = vertex.cos(out);
            // The density of the draw itself: rounding must not change it.
            let pdf = sample.pdf_w;
            let pdf_reverse = match self.origin {
                Origin::Camera => {
                    self.throughput *= sample.weight;
                    vertex.pdf_back(out)
                }
                Origin::Light => {
                    let eval = vertex.towards_camera(out)?;
                    self.throughput = vertex.throughput * eval.value * (cos_out / pdf);
                    eval.pdf_w
                }
            };
            let step = Step {
                cos_out,
                pdf,
                pdf_reverse,
            };
            self.partial.scatter(&step, &self.merging);
        }
        self.leave(vertex, sample.lobe, out);
        (self.throughput != Rgb::ZERO).then_some(!sample.delta)
    }

    /// Draws the next direction of a camera walk that merges at all rough lobes and is weighed against nothing: `None`
    /// where a rough lobe was drawn, or the walk ends.
    pub(super) fn follow_sharp(&mut self, vertex: &Vertex, u: [f32; 3]) -> Option<()> {
        let sample = vertex.bsdf.sample(vertex.alpha, vertex.local, u)?;
        let out = vertex.frame.to_world(sample.wi);
        let rough = !sample.delta && (sample.lobe == Lobe::Diffuse || vertex.merges_gloss());
        if rough || out.dot(vertex.surface.ng) * sample.wi.z <= 0.0 {
            return None;
        }
        self.throughput *= if sample.delta {
            sample.weight
        } else {
            // Of the glossy lobe alone: the base has merged.
            let gloss = vertex.bsdf.query(vertex.local, sample.wi)?.gloss();
            let eval = gloss.at(vertex.alpha);
            eval.value / eval.pdf_w
        };
        self.leave(vertex, sample.lobe, out);
        (self.throughput != Rgb::ZERO).then_some(())
    }

    /// Sets out from a vertex along `out`.
    #[inline]
    fn leave(&mut self, vertex: &Vertex, lobe: Lobe, out: Vec3) {
        if lobe == Lobe::Transmission {
            if self.origin == Origin::Camera {
                self.roulette_scale *= vertex.bsdf.refraction_scale(vertex.local);
            }
            if self.scene.tracks_bodies() {
                self.bodies = vertex.bodies_towards(self.scene, out);
            }
        }
        self.parallel = false;
        self.ray = vertex.surface.spawn(out);
    }

    /// Goes on along a Dirac lobe. The light walk's weight follows from the ratio of the two measures: with
    /// η²|cos ns| dω the same on both sides of a refraction, its flux keeps its η² and gains the cosines' ratio.
    #[inline]
    fn dirac(&mut self, vertex: &Vertex, sample: &BsdfSample, out: Vec3) -> Option<()> {
        // An interface between equal indices does not refract.
        let refracts = sample.lobe == Lobe::Transmission && !vertex.bsdf.is_delta_at(1.0);
        let refraction_scale = if refracts {
            vertex.bsdf.refraction_scale(vertex.local)
        } else {
            1.0
        };
        self.throughput *= sample.weight;
        if self.origin == Origin::Light {
            // Shading cosines in the frame for the camera's side, like the value.
            let frame = vertex.surface.frame_for(out);
            let (wi, wo) = (vertex.back.dot(frame.n), out.dot(frame.n));
            if vertex.back.dot(vertex.surface.ng) * wi <= 0.0 {
                return None;
            }
            let ng = vertex.surface.ng;
            let cosines = (wi * out.dot(ng)) / (wo * vertex.back.dot(ng));
            self.throughput *= refraction_scale * cosines.abs();
        }
        self.partial
            .dirac(vertex.cos(vertex.back), 1.0 / refraction_scale);
        Some(())
    }

    /// Russian roulette; `None` for a walk that ends.
    #[inline]
    pub(super) fn survive(&mut self, u: f32) -> Option<()> {
        let survival = roulette::survival(self.throughput, self.roulette_scale, u)?;
        self.throughput /= survival;
        Some(())
    }
}
