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
//! correlation is harmless, and a table of zeros gives pictures bit-identical to plain path tracing.

use super::walk::observer::PathObserver;
use super::walk::pending_emission::EmissionWeight;
use super::walk::roughening::{remember, roughen};
use super::walk::shading_point::Continuation;
use super::walk::shading_point::PendingEmission;
use super::walk::{Arrival, PendingWeight, Walk};
use crate::bsdf::{Bsdf, Lobe, SharedNumbers};
use crate::math::Rgb;
use crate::regularise::Roughening;
use crate::sampler::Sampler;
use directions::Directions;

pub(super) mod directions;
pub(super) mod manifold;
mod mollify;
mod tiles;

/// A unidirectional path tracer with next-event estimation.
#[derive(Clone, Copy, Debug)]
pub struct PathTracer<R> {
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette begins.
    pub roulette_start: u32,
    /// True to continue paths with the roughened lobe.
    pub reuse: bool,
    /// The rule that roughens the last vertex.
    pub rule: R,
}

impl<R> PathTracer<R> {
    /// The same with another rule.
    pub(crate) fn with<Q>(&self, rule: Q) -> PathTracer<Q> {
        PathTracer {
            max_vertices: self.max_vertices,
            roulette_start: self.roulette_start,
            reuse: self.reuse,
            rule,
        }
    }
}

impl<R: Roughening> PathTracer<R> {
    /// Radiance that arrives along a camera walk, along all ways of a policy: one independent estimate.
    ///
    /// `sample` is the number of the sample in its pixel, for rules whose bias vanishes.
    #[inline(always)]
    pub(in crate::integrator) fn radiance<D: Directions, S: Sampler + Clone, O: PathObserver>(
        &self,
        mut directions: D,
        walk: Walk<'_>,
        sample: u32,
        sampler: &S,
        observer: &mut O,
    ) -> Rgb {
        let mut total = Rgb::ZERO;
        loop {
            let sampler = &mut sampler.clone();
            let value = self.radiance_of_way(&mut directions, walk, sample, sampler, observer);
            let share = directions.share();
            total += share * value;
            observer.way(share);
            if !directions.turn() {
                return total;
            }
        }
    }

    /// The same along one way.
    #[inline(always)]
    fn radiance_of_way<D: Directions, S: Sampler, O: PathObserver>(
        &self,
        directions: &mut D,
        mut walk: Walk<'_>,
        sample: u32,
        sampler: &mut S,
        observer: &mut O,
    ) -> Rgb {
        let mut total = Rgb::ZERO;
        let mut memory = self.rule.start(sample);
        let mut emission = PendingEmission::of(EmissionWeight::full(Rgb::ONE));
        let mut made = Bsdf::BLACK;
        // True until the first draw from a non-Dirac lobe.
        let mut is_seen = true;
        for n in 1..=self.max_vertices + 1 {
            let mut arrival = walk.arrive(&mut emission, sampler);

            // ── emission at the end of the ray
            if !emission.is_zero()
                && directions.counts(arrival.as_ref())
                && let Some(met) = walk.emission(arrival.as_ref())
            {
                let found = emission.contribution(&met, observer);
                observer.light(n - 1, found);
                if is_seen {
                    observer.dirac_only_light(found);
                }
                directions.met(found);
                total += found;
            }
            let Some(Arrival { hit, surface }) =
                arrival.as_mut().filter(|_| n <= self.max_vertices)
            else {
                break;
            };

            // ── the vertex
            let u = sampler.vertex();
            let bsdf = walk.bsdf(surface, u.material, &mut made);
            let vertex = walk.interaction(surface, bsdf);
            let alpha_reg = roughen(&self.rule, &memory, vertex.alpha);
            let point = walk.shading_point(&vertex, alpha_reg, self.max_vertices - n);
            observer.vertex(n, hit.t, &point);
            directions.arrive(&point, &u, sampler);

            // ── next-event estimation at α′
            let roughened = R::ACTIVE && point.is_roughened();
            let pdf = |wi, pdf_w| match roughened {
                true => pdf_w,
                false => directions.pdf(wi, pdf_w),
            };
            let found = point.direct_light_among(u.light, observer, pdf);
            observer.light(n, found);
            directions.found(found);
            total += found;
            let beyond = directions.beyond(&walk, &vertex, &point, &u);
            if beyond != Rgb::ZERO {
                observer.light(n, beyond);
                total += beyond;
            }

            // ── the continuation, and emission found by the BSDF at α′
            let reused = roughened && self.reuse && !point.is_pane();
            let lobe = SharedNumbers::new(u.lobe);
            let drawn_at = if reused { alpha_reg } else { vertex.alpha };
            let next = directions.sample(&point, drawn_at, &lobe);
            let diffuse = |next: &Continuation| !D::GUIDED && next.sample.lobe == Lobe::Diffuse;
            let shared = !roughened || reused || next.as_ref().is_some_and(diffuse);
            if !shared {
                let found = point.roughened_emission(&lobe, observer);
                observer.light(n, found);
                directions.found(found);
                total += found;
            }
            let Some(next) = next else { break };
            let is_first = is_seen && !next.sample.delta;
            is_seen &= next.sample.delta;
            let straight = point.goes_straight(&next.sample);
            if straight {
                emission.scale(next.sample.weight);
            } else if shared {
                emission = point.shared_emission::<O>(&next.sample, roughened, reused);
            } else {
                emission = PendingEmission::COUNTED;
            }
            if next.sample.delta
                && !straight
                && let Some(radius) = self.rule.mollifier_radius(&memory)
            {
                let found = point.mollified(&next, radius, u.light);
                observer.light(n, found);
                total += found;
            }
            remember(&self.rule, &mut memory, &point, &next.sample, observer);
            if straight {
                walk.pass(vertex.surface, &next);
            } else {
                walk.scatter(&vertex, &next);
            }
            let mut roulette = u.roulette;
            if is_first
                && let Some(chance) = directions.survival()
                && !walk.survive_with(chance, &mut roulette, &mut emission)
            {
                break;
            }
            let roulette = (n >= self.roulette_start).then_some(roulette);
            if !walk.survive(roulette, &mut emission) {
                break;
            }
            directions.leave(&vertex, &next, walk.throughput, sampler);
        }
        directions.finish();
        total
    }
}
