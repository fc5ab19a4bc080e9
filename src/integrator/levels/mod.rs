//! The path-tracing loop at several levels of roughening on the same paths.
//!
//! Level 0 is plain path tracing, bit-identical with independent samples; level k roughens the last vertex by a
//! multiple of a rule's (`factors`). All levels share prefix, throughput, roulette and continuation: regularised
//! next-event estimation only evaluates the last lobe again. At a vertex that some level roughens
//!
//! 1. one light sample and one shadow ray are evaluated at the roughness of every level;
//! 2. directions are drawn from the lobes of some levels (`vertex`), and emission at their ends is evaluated at every
//!    level that roughens this vertex, weighted against the light with the density of all draws together;
//! 3. the path continues with a draw at its own roughness. Emission at its end counts as in plain path tracing at the
//!    levels that do not roughen the vertex, and as one more draw at those that do.
//!
//! Plain path tracing cannot find a light without area at the end of a Dirac lobe. The levels below the first that
//! finds it copy it from there, so that it does not count as bias.

mod factors;
mod one;
mod packed;
mod tiles;
mod vertex;

use super::View;
use super::amounts::{LevelError, SCALES, Scales};
use super::walk::observer::{PathObserver, Recorder};
use super::walk::roughening::scattered;
use super::walk::ways::Ways;
use super::walk::{Arrival, HitEmission, PendingWeight, Walk};
use crate::bsdf::Bsdf;
use crate::image::film::Film;
use crate::image::level_film::{LevelFilm, MAX_LEVELS};
use crate::math::Rgb;
use crate::regularise::{Accumulated, Rule};
use crate::sampler::{CameraSource, Sampler};
use factors::{LevelMemory, ScaledFactors};
use packed::PathSums;
use std::ops::Range;
use tiles::LevelPaths;
pub(super) use tiles::{estimate, pass_bytes};
use vertex::{PendingLevels, RoughenedVertex};

/// Path tracer at several levels.
#[derive(Clone, Debug)]
pub(super) struct LevelTracer {
    max_vertices: u32,
    roulette_start: u32,
    factors: ScaledFactors,
}

impl LevelTracer {
    /// Tracer of levels at these scales of a rule.
    pub(super) fn new(
        rule: &Rule,
        scales: &Scales,
        max_vertices: u32,
        roulette_start: u32,
    ) -> Result<Self, LevelError> {
        if matches!(rule, Rule::Accumulated(Accumulated { lambda, .. }) if *lambda != 0.0) {
            return Err(LevelError::Consistent);
        }
        let factors = ScaledFactors::new(rule, &scales.as_slice()[1..]);
        let factors = factors.ok_or(LevelError::Rule)?;
        Ok(Self {
            max_vertices,
            roulette_start,
            factors,
        })
    }

    /// Number of levels.
    pub(super) fn levels(&self) -> usize {
        self.factors.levels()
    }

    /// Calls [`estimate`] with arrays for the default number of levels, or for the largest number.
    pub(super) fn estimate<O: Recorder>(
        &self,
        view: &View<'_>,
        source: &CameraSource,
        samples: Range<u32>,
        film: &mut Film,
        levels: &mut LevelFilm,
        recorder: &mut O,
    ) -> u32 {
        let run = if self.levels() <= SCALES.len() {
            estimate::<{ SCALES.len() }, Self, O>
        } else {
            estimate::<MAX_LEVELS, Self, O>
        };
        run(self, view, source, samples, film, levels, recorder)
    }

    /// Radiance that arrives along one way of a camera walk. The parity of `turn`, odd in half of the samples, decides
    /// at which vertices a second lobe is drawn from.
    fn radiance<const N: usize, S: Sampler, O: PathObserver>(
        &self,
        mut walk: Walk<'_>,
        turn: u32,
        sampler: &mut S,
        (ways, observer): (&mut Ways, &mut O),
    ) -> PathSums<N> {
        let mut sums = PathSums::new();
        let mut memory = LevelMemory::<N>::default();
        let mut emission = PendingLevels::full();
        let mut made = Bsdf::BLACK;
        // True until the first draw from a non-Dirac lobe.
        let mut dirac_only = true;
        for n in 1..=self.max_vertices + 1 {
            let mut arrival = walk.arrive(&mut emission, sampler);

            // ── emission at the end of the ray
            if !emission.is_zero()
                && let Some(hit_emission) = walk.emission(arrival.as_ref())
            {
                sums.add(&emission, &hit_emission);
            }
            let Some(Arrival { hit, surface }) = &mut arrival else {
                break;
            };
            if n > self.max_vertices {
                break;
            }

            // ── the vertex
            let u = sampler.vertex();
            let bsdf = walk.bsdf(surface, u.material, &mut made);
            let vertex = walk.interaction(surface, bsdf);
            let alpha = vertex.alpha;
            let point = walk.shading_point(&vertex, alpha, self.max_vertices - n);
            observer.vertex(n, hit.t, &point);
            sums.features.add(&point, hit.t);

            // ── next-event estimation, emission found by roughened lobes, and the continuation
            // An interface between equal indices is a delta at any roughness.
            let mut alphas = [alpha; N];
            let roughened = alpha < 1.0
                && !bsdf.is_delta_at(1.0)
                && memory.roughen(&self.factors, alpha, &mut alphas);
            let lobe = match dirac_only {
                true => ways.choose(bsdf, alpha, point.wo, u.lobe),
                false => u.lobe,
            };
            let next = point.sample(alpha, lobe);
            let straight = (next.as_ref()).is_some_and(|next| point.goes_straight(&next.sample));
            if !straight {
                emission.is_roughened = false;
            }
            if roughened {
                let drawn = next.as_ref().map(|next| &next.sample);
                let lobes = RoughenedVertex::new(&point, &alphas, drawn);
                sums.unseen += lobes.direct_light(u.light, &mut sums.levels);
                lobes.lobe_light(turn.wrapping_add(n), u.lobe, &mut sums.levels);
                if !straight {
                    lobes.leave(drawn, &mut emission);
                }
            } else {
                sums.add_shared(point.direct_light(u.light, &mut ()));
            }
            let Some(next) = next else { break };
            if straight {
                emission.scale(next.sample.weight);
            } else {
                emission.plain = point.own_emission(&next.sample);
            }
            memory.push(&self.factors, scattered(alpha, &next.sample).alpha);
            if straight {
                walk.pass(vertex.surface, &next);
            } else {
                walk.scatter(&vertex, &next);
            }
            let mut roulette = u.roulette;
            if dirac_only && !next.sample.delta {
                dirac_only = false;
                if !walk.survive_with(ways.survival(), &mut roulette, &mut emission) {
                    break;
                }
            }
            let roulette = (n >= self.roulette_start).then_some(roulette);
            if !walk.survive(roulette, &mut emission) {
                break;
            }
        }
        sums
    }
}

impl<const N: usize> LevelPaths<N> for LevelTracer {
    fn levels(&self) -> usize {
        Self::levels(self)
    }

    fn trace<S: Sampler + Clone, O: PathObserver>(
        &self,
        walk: Walk<'_>,
        _sample: u32,
        turn: u32,
        sampler: &S,
        observer: &mut O,
    ) -> PathSums<N> {
        let (mut ways, mut sums) = (Ways::all(), PathSums::new());
        loop {
            let sampler = &mut sampler.clone();
            let way = self.radiance(walk, turn, sampler, (&mut ways, observer));
            sums.add_way(&way, ways.share());
            observer.way(ways.share());
            if !ways.turn() {
                return sums;
            }
        }
    }
}

impl<const N: usize> PathSums<N> {
    /// Adds emission at a ray's end: weighted as in plain path tracing unless the level roughened the previous vertex.
    #[inline]
    fn add(&mut self, emission: &PendingLevels<N>, hit: &HitEmission<'_>) {
        let plain = if emission.plain.is_zero() {
            Rgb::ZERO
        } else {
            emission.plain.contribution(hit)
        };
        let Some(roughened) = emission.roughened() else {
            return self.add_shared(plain);
        };
        let values = roughened.contribution(hit.radiance, hit.pdf_light());
        for (k, t) in self.levels.iter_mut().enumerate() {
            *t += if roughened.roughens(k) {
                values[k]
            } else {
                plain
            };
        }
    }
}
