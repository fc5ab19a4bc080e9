//! The path-tracing loop: Algorithm 1 of `[OPSR]` with the multiple importance sampling of its section 5.1.
//!
//! At every vertex, with α the closure's own roughness and α′ ≥ α the regularised one:
//!
//! 1. a light is sampled, the closure evaluated at α′;
//! 2. a direction is drawn from the closure at α′, and only emission at its end counts;
//! 3. the path goes on with a direction drawn from the closure at α, whose emission is not counted again.
//!
//! Where α′ = α, and wherever the diffuse lobe was drawn (whose direction does not depend on the roughness), (2) and
//! (3) are one ray. Both draws use the same random numbers: (2) and (3) estimate disjoint sets of paths, so their
//! correlation is harmless, and a table of zeros is the plain path tracer to the bit.

use super::walk::observer::{PathObserver, Vertex};
use crate::bsdf::{BsdfSample, DELTA_ALPHA, Lobe};
use crate::integrator::walk::bodies::Medium;
use crate::integrator::walk::pending_emission::Arrival;
use crate::integrator::walk::shading_point::Here;
use crate::math::{Ray, Rgb};
use crate::regularise::{Regulariser, Scattered};
use crate::sampler::Sampler;
use crate::scene::Scene;

mod mollify;

/// A unidirectional path tracer with next-event estimation.
#[derive(Clone, Copy, Debug)]
pub struct PathTracer<R> {
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Russian roulette begins after this many vertices.
    pub roulette_start: u32,
    /// How the last vertex is roughened.
    pub regulariser: R,
}

impl<R: Regulariser> PathTracer<R> {
    /// Radiance that arrives along a camera ray: one independent estimate.
    ///
    /// `sample` is the number of the sample in its pixel, which only the consistent variant looks at.
    pub fn radiance<S: Sampler, O: PathObserver>(
        &self,
        scene: &Scene,
        mut ray: Ray,
        sample: u32,
        sampler: &mut S,
        observer: &mut O,
    ) -> Rgb {
        let mut total = Rgb::ZERO;
        let mut throughput = Rgb::ONE;
        // Refraction scales radiance by 1/η²; roulette must not mistake that for lost light.
        let mut eta_scale = 1.0f32;
        let mut medium = Medium::default();
        let mut memory = self.regulariser.start(sample);
        let mut arrival = Arrival::full(Rgb::ONE);
        for n in 1..=self.max_vertices + 1 {
            let Some(hit) = scene.intersect(&ray) else {
                if scene.parts().environment.is_some() {
                    arrival.scale(medium.transmittance(scene, f32::INFINITY));
                    total += arrival.weigh(
                        scene.lights().environment(ray.dir),
                        || scene.lights().pdf_environment(ray.dir),
                        observer,
                    );
                }
                break;
            };
            let surface = scene.surface(&hit);
            if !medium.is_empty() {
                let transmittance = medium.transmittance(scene, hit.t);
                throughput *= transmittance;
                arrival.scale(transmittance);
            }

            // ── emission met by the ray
            let radiance = scene.lights().emitted(&surface, -ray.dir);
            if radiance != Rgb::ZERO && arrival.throughput != Rgb::ZERO {
                total += arrival.weigh(
                    radiance,
                    || scene.lights().pdf_emitter(ray.origin, &surface),
                    observer,
                );
            }
            if n > self.max_vertices {
                break;
            }

            // ── the vertex
            let u = sampler.vertex();
            let bsdf = scene.bsdf(&surface, u.material);
            let alpha = bsdf.alpha();
            let alpha_reg = self.roughen(&memory, alpha);
            let frame = surface.frame_for(-ray.dir);
            let here = Here {
                scene,
                surface,
                frame,
                bsdf,
                wo: frame.to_local(-ray.dir),
                alpha,
                alpha_reg,
                throughput,
                medium,
            };
            if O::VERTICES {
                let vertex = Vertex {
                    scene,
                    n,
                    surface: &surface,
                    bsdf: &bsdf,
                    wo: -ray.dir,
                    distance: hit.t,
                    alpha_reg,
                };
                observer.vertex(&vertex);
            }

            // ── next-event estimation at α′
            total += here.sample_light(u.light, observer);

            // ── the emission that the closure at α′ finds, and the way on
            let (found, next) = here.scatter::<R, O>(&u, observer);
            total += found;
            let Some(next) = next else { break };
            if R::MOLLIFIES && next.sample.delta && !scene.parts().lights.is_empty() {
                let bandwidth = self.regulariser.bandwidth(&memory);
                total += here.mollified(&next, bandwidth, u.light);
            }
            arrival = next.arrival;
            throughput *= next.sample.weight;
            self.remember(&mut memory, &here, &next.sample, observer);
            if next.sample.lobe == Lobe::Transmission {
                eta_scale *= here.bsdf.refraction_scale(here.wo);
                medium = here.medium_towards(next.wi);
            }

            // ── the end of a path that carries nothing
            if throughput == Rgb::ZERO && arrival.carries_nothing() {
                break;
            }

            // ── Russian roulette
            if n >= self.roulette_start {
                // A throughput that is not a number survives, and is found and reported in the total.
                let survival = (throughput * eta_scale).max_element().min(0.95);
                if u.roulette >= survival {
                    break;
                }
                throughput /= survival;
                arrival.scale(Rgb::splat(1.0 / survival));
            }
            ray = surface.spawn(next.wi);
        }
        observer.finish(total);
        total
    }

    /// Roughness at next-event estimation; a lobe that stays below the Dirac bound stays as it is.
    #[inline]
    fn roughen(&self, memory: &R::Path, alpha: f32) -> f32 {
        if !R::ACTIVE || alpha >= 1.0 {
            return alpha;
        }
        let alpha_reg = self.regulariser.roughen(memory, alpha);
        if alpha_reg < DELTA_ALPHA {
            alpha
        } else {
            alpha_reg
        }
    }

    /// Tells the rule and the observer which lobe the path went on from.
    #[inline]
    fn remember<O: PathObserver>(
        &self,
        memory: &mut R::Path,
        here: &Here<'_>,
        sample: &BsdfSample,
        observer: &mut O,
    ) {
        let alpha = if sample.lobe == Lobe::Diffuse {
            1.0
        } else {
            here.alpha
        };
        if R::ACTIVE {
            let pdf_w = if sample.delta {
                f32::INFINITY
            } else {
                sample.pdf_w
            };
            self.regulariser.scatter(memory, Scattered { alpha, pdf_w });
        }
        observer.scattered(alpha);
    }
}
