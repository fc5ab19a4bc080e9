//! The path-tracing loop: Algorithm 1 of `[OPSR]` with the multiple importance sampling of its section 5.1.
//!
//! At every vertex, with α the BSDF's own roughness and α′ ≥ α the roughened one:
//!
//! 1. a light is sampled, the BSDF evaluated at α′;
//! 2. a direction is drawn from the BSDF at α′, and only emission at its end counts;
//! 3. the path continues in a direction drawn from the BSDF at α, whose emission is not counted again.
//!
//! With α′ = α, and after a draw from the diffuse lobe (whose direction does not depend on the roughness), (2) and (3)
//! are one ray. Both draws use the same random numbers: (2) and (3) estimate disjoint sets of paths, so their
//! correlation is harmless, and a table of zeros makes the bytes of plain path tracing.

use super::walk::bodies::EnclosingBodies;
use super::walk::dispersion::Channel;
use super::walk::observer::PathObserver;
use super::walk::pending_emission::PendingEmission;
use super::walk::roughening::{remember, roughen};
use super::walk::roulette;
use super::walk::shading_point::ShadingPoint;
use crate::bsdf::{Lobe, SharedNumbers};
use crate::math::{Ray, Rgb};
use crate::regularise::Roughening;
use crate::sampler::Sampler;
use crate::scene::Scene;

mod mollify;
mod tiles;

/// A unidirectional path tracer with next-event estimation.
#[derive(Clone, Copy, Debug)]
pub struct PathTracer<R> {
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette begins.
    pub roulette_start: u32,
    /// Continue paths with the roughened lobe.
    pub reuse: bool,
    /// The rule that roughens the last vertex.
    pub rule: R,
}

impl<R> PathTracer<R> {
    /// The same with another rule.
    pub fn with<Q>(&self, rule: Q) -> PathTracer<Q> {
        PathTracer {
            max_vertices: self.max_vertices,
            roulette_start: self.roulette_start,
            reuse: self.reuse,
            rule,
        }
    }
}

impl<R: Roughening> PathTracer<R> {
    /// Radiance that arrives along a camera ray: one independent estimate. `bodies` are those around the camera.
    ///
    /// `sample` is the number of the sample in its pixel, for rules whose bias vanishes.
    pub fn radiance<S: Sampler, O: PathObserver>(
        &self,
        scene: &Scene,
        mut ray: Ray,
        mut bodies: EnclosingBodies,
        sample: u32,
        sampler: &mut S,
        observer: &mut O,
    ) -> Rgb {
        let mut total = Rgb::ZERO;
        let mut throughput = Rgb::ONE;
        let mut channel = Channel::default();
        // Refraction scales radiance by 1/η²; roulette must not mistake that for lost light.
        let mut eta_scale = 1.0f32;
        let mut memory = self.rule.start(sample);
        let mut emission = PendingEmission::full(Rgb::ONE);
        for n in 1..=self.max_vertices + 1 {
            let segment = bodies.follow(scene, &ray);
            if let Some(passed) = segment.passed {
                throughput *= passed;
                emission.scale(passed);
            }
            let Some(hit) = &segment.hit else {
                if scene.parts().environment.is_some() {
                    emission.scale(bodies.transmittance(scene, f32::INFINITY));
                    let found = emission.contribution(
                        scene.lights().environment(ray.dir),
                        || scene.lights().pdf_environment(ray.origin, ray.dir),
                        observer,
                    );
                    observer.light(n - 1, found);
                    total += found;
                }
                break;
            };
            let mut surface = scene.surface(hit);
            if !bodies.is_empty() {
                let transmittance = bodies.transmittance(scene, hit.t - segment.start);
                throughput *= transmittance;
                emission.scale(transmittance);
            }

            // ── emission met by the ray
            let radiance = scene.lights().emitted(&surface, -ray.dir);
            if radiance != Rgb::ZERO && emission.throughput != Rgb::ZERO {
                let found = emission.contribution(
                    radiance,
                    || scene.lights().pdf_emitter(ray.origin, &surface),
                    observer,
                );
                observer.light(n - 1, found);
                total += found;
            }
            if n > self.max_vertices {
                break;
            }

            // ── the vertex
            let u = sampler.vertex();
            let mut bsdf = channel.bsdf(scene, &mut surface, u.material, &mut throughput);
            bodies.interface(scene, &mut surface, ray.dir, &mut bsdf);
            let alpha = bsdf.alpha();
            let frame = surface.frame_for(-ray.dir);
            let point = ShadingPoint {
                scene,
                surface: &surface,
                frame,
                bsdf: &bsdf,
                wo: frame.to_local(-ray.dir),
                alpha,
                alpha_reg: roughen(&self.rule, &memory, alpha),
                throughput,
                bodies: &bodies,
            };
            observer.vertex(n, hit.t, &point);

            // ── next-event estimation at α′
            let direct = point.direct_light(u.light, observer);
            observer.light(n, direct);
            total += direct;

            // ── the continuation, and emission found by the BSDF at α′
            let roughened = R::ACTIVE && point.is_roughened();
            let reused = roughened && self.reuse;
            let lobe = SharedNumbers::new(u.lobe);
            let next = point.sample(if reused { point.alpha_reg } else { alpha }, &lobe);
            let diffuse = (next.as_ref()).is_some_and(|next| next.sample.lobe == Lobe::Diffuse);
            let shared = !roughened || reused || diffuse;
            if !shared {
                let found = point.roughened_emission(&lobe, observer);
                observer.light(n, found);
                total += found;
            }
            let Some(next) = next else { break };
            emission = if shared {
                point.shared_emission::<O>(&next.sample, roughened, reused)
            } else {
                PendingEmission::COUNTED
            };
            if next.sample.delta
                && !scene.parts().lights.is_empty()
                && let Some(radius) = self.rule.mollifier_radius(&memory)
            {
                let found = point.mollified(&next, radius, u.light);
                observer.light(n, found);
                total += found;
            }
            throughput *= next.sample.weight;
            remember(&self.rule, &mut memory, &point, &next.sample, observer);
            if next.sample.lobe == Lobe::Transmission {
                eta_scale *= point.bsdf.refraction_scale(point.wo);
                if scene.tracks_bodies() {
                    bodies = point.bodies_towards(next.wi);
                }
            }

            // ── the end of a path that carries nothing
            if throughput == Rgb::ZERO && emission.is_nothing() {
                break;
            }

            // ── Russian roulette
            if n >= self.roulette_start {
                let Some(survival) = roulette::survival(throughput, eta_scale, u.roulette) else {
                    break;
                };
                throughput /= survival;
                emission.scale(Rgb::splat(1.0 / survival));
            }
            ray = surface.spawn(next.wi);
        }
        observer.finish(total);
        total
    }
}
