//! The path-tracing loop at several levels of roughening on the same paths.
//!
//! Level 0 is plain path tracing, bit-identical with independent samples; level k roughens the last vertex by a multiple of a
//! rule (`strength`). All levels share prefix, throughput, roulette and continuation, since regularised next-event
//! estimation leaves the path alone: only the last lobe is evaluated again. At a vertex that some level roughens
//!
//! 1. one light sample and one shadow ray are evaluated at the roughness of every level;
//! 2. directions are drawn from the lobes of some levels (`vertex`), and emission at their ends is evaluated at every
//!    level that roughens this vertex, weighted against the light with the density of all draws together;
//! 3. the path continues with a draw at its own roughness. Emission at its end is plain path tracing's for the levels that
//!    leave the vertex alone, and one more draw for those that roughen it.
//!
//! Light without area at the end of a Dirac lobe is beyond plain path tracing. The levels below the first that finds it
//! take it from there, so that it does not count as bias.

mod strength;
mod tiles;
mod vertex;

use super::walk::bodies::EnclosingBodies;
use super::walk::dispersion::Channel;
use super::walk::observer::PathObserver;
use super::walk::pending_emission::PendingEmission;
use super::walk::roughening::scattered;
use super::walk::roulette;
use super::walk::shading_point::ShadingPoint;
use crate::bsdf::Lobe;
use crate::image::level_film::MAX_LEVELS;
use crate::math::{Ray, Rgb};
use crate::regularise::{Accumulated, Rule};
use crate::sampler::Sampler;
use crate::scene::Scene;
use strength::{LevelMemory, Strength};
use vertex::{PendingLevels, Vertex};

/// Scales of five levels: plain path tracing, and the factors from 0.128 to 16 times as large. A sixth level does not make
/// better pictures, and scales below a tenth are rarely chosen at 64 samples.
pub const SCALES: [f32; 5] = [0.0, 0.128, 0.64, 3.2, 16.0];

/// Scales of so many levels: plain path tracing, and down from the roughest by factors of 5; empty for one level. `None` for
/// none or more than [`MAX_LEVELS`].
pub fn scales(levels: usize) -> Option<Vec<f32>> {
    let roughest = SCALES[SCALES.len() - 1];
    let scale = |k: usize| roughest * 0.2f32.powi((levels - 1 - k) as i32);
    match levels {
        1 => Some(Vec::new()),
        n if n == SCALES.len() => Some(SCALES.to_vec()),
        2..=MAX_LEVELS => Some(std::iter::once(0.0).chain((1..levels).map(scale)).collect()),
        _ => None,
    }
}

/// Settings that cannot have several levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LevelError {
    /// The levels of plain path tracing are equal, and other rules have no number to scale.
    #[error("several levels need a table, a constant factor, filter-glossy or roughness-clamp")]
    Rule,
    /// A path that continues with the roughened lobe belongs to one level.
    #[error("the reuse mode continues a path with the roughened lobe: it has one level only")]
    Reuse,
    /// Other estimators have no rule.
    #[error("several levels are for the path tracer without a guide")]
    Estimator,
    /// The levels are chosen afterwards, so that their bias vanishes anyhow.
    #[error("the consistent variant has one level only")]
    Consistent,
    /// Wrong scales.
    #[error("expected 2 to {MAX_LEVELS} scales of levels, ascending from 0")]
    Scales,
}

/// Path tracer at several levels.
#[derive(Clone, Debug)]
pub(super) struct LevelTracer {
    max_vertices: u32,
    roulette_start: u32,
    strength: Strength,
}

/// Roughness from which light at a vertex is blurred by its surroundings there, not by those of its mirror image.
const ROUGH: f32 = 0.05;

/// Values of the levels of one path.
pub(super) type Values = [Rgb; MAX_LEVELS];

/// Radiance of one path.
#[derive(Default)]
struct PathSums {
    /// An independent estimate at every level.
    levels: Values,
    /// Light that no level roughens: the same at all levels.
    shared: Rgb,
    /// Normal of the first rough vertex and the path's length to it; of the last vertex where none is rough.
    features: [f32; 4],
    /// What plain path tracing cannot find, at the least roughened level that can.
    unseen: Rgb,
}

impl LevelTracer {
    /// Tracer of levels at these scales of a rule.
    pub(super) fn new(
        rule: &Rule,
        scales: &[f32],
        max_vertices: u32,
        roulette_start: u32,
    ) -> Result<Self, LevelError> {
        if matches!(rule, Rule::Accumulated(Accumulated { lambda, .. }) if *lambda != 0.0) {
            return Err(LevelError::Consistent);
        }
        let strength = Strength::new(rule, scales.get(1..).unwrap_or(&[]));
        let strength = strength.ok_or(LevelError::Rule)?;
        let finite = scales.iter().all(|s| s.is_finite());
        let ascending = scales.is_sorted_by(|a, b| a < b);
        if !(2..=MAX_LEVELS).contains(&scales.len()) || scales[0] != 0.0 || !ascending || !finite {
            return Err(LevelError::Scales);
        }
        Ok(Self {
            max_vertices,
            roulette_start,
            strength,
        })
    }

    /// Number of levels.
    pub(super) fn levels(&self) -> usize {
        self.strength.levels()
    }

    /// Radiance that arrives along a camera ray. `turn` says whether a second lobe is drawn from: any number, odd in
    /// half of the samples.
    fn radiance<S: Sampler, O: PathObserver>(
        &self,
        scene: &Scene,
        mut ray: Ray,
        mut bodies: EnclosingBodies,
        turn: u32,
        sampler: &mut S,
        observer: &mut O,
    ) -> PathSums {
        let levels = self.levels();
        let mut sums = PathSums::default();
        let mut has_features = false;
        let mut throughput = Rgb::ONE;
        let mut channel = Channel::default();
        let mut eta_scale = 1.0f32;
        let mut memory = LevelMemory::default();
        let mut emission = PendingEmission::full(Rgb::ONE);
        // Emission at the levels that roughened the vertex before.
        let mut pending: Option<PendingLevels> = None;
        for n in 1..=self.max_vertices + 1 {
            let segment = bodies.follow(scene, &ray);
            if let Some(passed) = segment.passed {
                throughput *= passed;
                emission.scale(passed);
                if let Some(pending) = &mut pending {
                    pending.scale(passed);
                }
            }
            let Some(hit) = &segment.hit else {
                if scene.parts().environment.is_some() {
                    let transmittance = bodies.transmittance(scene, f32::INFINITY);
                    emission.scale(transmittance);
                    let radiance = scene.lights().environment(ray.dir);
                    let pdf_light = || scene.lights().pdf_environment(ray.origin, ray.dir);
                    let plain = emission.contribution(radiance, pdf_light, &mut ());
                    sums.add(plain, pending.as_ref(), |p| {
                        p.contribution(radiance * transmittance, pdf_light())
                    });
                }
                break;
            };
            let mut surface = scene.surface(hit);
            if !bodies.is_empty() {
                let transmittance = bodies.transmittance(scene, hit.t - segment.start);
                throughput *= transmittance;
                emission.scale(transmittance);
                if let Some(pending) = &mut pending {
                    pending.scale(transmittance);
                }
            }

            // ── emission met by the ray
            let radiance = scene.lights().emitted(&surface, -ray.dir);
            if radiance != Rgb::ZERO && (emission.throughput != Rgb::ZERO || pending.is_some()) {
                let pdf_light = || scene.lights().pdf_emitter(ray.origin, &surface);
                let plain = if emission.throughput == Rgb::ZERO {
                    Rgb::ZERO
                } else {
                    emission.contribution(radiance, pdf_light, &mut ())
                };
                sums.add(plain, pending.as_ref(), |p| {
                    p.contribution(radiance, pdf_light())
                });
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
                alpha_reg: alpha,
                throughput,
                bodies: &bodies,
            };
            observer.vertex(n, hit.t, &point);
            if !has_features {
                let [x, y, z] = frame.n.to_array();
                sums.features = [x, y, z, sums.features[3] + hit.t];
                has_features = alpha >= ROUGH;
            }

            // ── next-event estimation, emission found by roughened lobes, and the continuation
            // An interface between equal indices is a delta at any roughness.
            let mut alphas = [alpha; MAX_LEVELS];
            let roughened = alpha < 1.0
                && !bsdf.is_delta_at(1.0)
                && memory.roughen(&self.strength, alpha, &mut alphas);
            let continuation = point.sample(alpha, u.lobe);
            pending = None;
            if roughened {
                let drawn = continuation.as_ref().map(|next| &next.sample);
                let vertex = Vertex::new(&point, &alphas, levels, drawn);
                sums.unseen += vertex.direct_light(u.light, &mut sums.levels[..levels]);
                vertex.lobe_light(turn.wrapping_add(n), u.lobe, &mut sums.levels[..levels]);
                pending = Some(vertex.pending(drawn));
            } else {
                sums.add_shared(point.direct_light(u.light, &mut ()));
            }
            let Some(next) = continuation else { break };
            emission = point.shared_emission::<()>(&next.sample, false, false);
            throughput *= next.sample.weight;
            memory.push(&self.strength, scattered(alpha, &next.sample));
            if next.sample.lobe == Lobe::Transmission {
                eta_scale *= point.bsdf.refraction_scale(point.wo);
                if scene.tracks_bodies() {
                    bodies = point.bodies_towards(next.wi);
                }
            }

            // ── the end of a path that carries nothing
            let nothing = pending.as_ref().is_none_or(PendingLevels::is_nothing);
            if throughput == Rgb::ZERO && emission.is_nothing() && nothing {
                break;
            }

            // ── Russian roulette
            if n >= self.roulette_start {
                let Some(survival) = roulette::survival(throughput, eta_scale, u.roulette) else {
                    break;
                };
                throughput /= survival;
                let scale = Rgb::splat(1.0 / survival);
                emission.scale(scale);
                if let Some(pending) = &mut pending {
                    pending.scale(scale);
                }
            }
            ray = surface.spawn(next.wi);
        }
        observer.finish(sums.levels[0]);
        sums
    }
}

impl PathSums {
    /// Adds light of a vertex that no level roughens.
    #[inline]
    fn add_shared(&mut self, value: Rgb) {
        self.shared += value;
        self.levels.iter_mut().for_each(|t| *t += value);
    }

    /// Adds emission at the end of a ray: plain path tracing's, or that of the levels that roughened the vertex before.
    #[inline]
    fn add(
        &mut self,
        plain: Rgb,
        pending: Option<&PendingLevels>,
        roughened: impl FnOnce(&PendingLevels) -> Values,
    ) {
        let Some(pending) = pending else {
            return self.add_shared(plain);
        };
        let values = roughened(pending);
        for (k, t) in self.levels.iter_mut().enumerate() {
            *t += if pending.roughens(k) {
                values[k]
            } else {
                plain
            };
        }
    }
}
