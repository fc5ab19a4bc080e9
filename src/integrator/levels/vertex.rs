//! A vertex that some level roughens: its lobe evaluated at all levels.
//!
//! Contributions have the mixture form of section 5 of the method: with h the integrand at a level's roughness, p_l the
//! density of the light sample and p₀ the densities of all draws from lobes added up, samples of every technique return
//! h / (p_l + p₀), the balance heuristic.

use crate::bsdf::{Bsdf, BsdfSample, DELTA_ALPHA, Lobe, LobeQuery};
use crate::integrator::walk::PendingWeight;
use crate::integrator::walk::pending_emission::EmissionWeight;
use crate::integrator::walk::shading_point::ShadingPoint;
use crate::math::{Rgb, Vec3};
use crate::sampler::LightU;

/// Lobes less than this factor apart in roughness share their draws, as in recordings for training.
const SPACING: f32 = 1.7;

/// Steps of the R2 sequence, by which further draws rotate the random numbers of the first.
const ROTATION: [f32; 2] = [0.754_877_7, 0.569_840_3];

/// Values of the levels of one path, of which there are `N` at most.
type Values<const N: usize> = [Rgb; N];

/// The lobe of a vertex at all levels, `N` at most.
#[derive(Clone, Copy)]
struct LevelLobe<const N: usize> {
    /// α′ of every level; α at level 0 and at levels that do not roughen the vertex.
    alphas: [f32; N],
    /// Expected number of draws from the lobe of every level.
    shares: [f32; N],
}

impl<const N: usize> LevelLobe<N> {
    #[inline]
    fn roughens(&self, k: usize) -> bool {
        self.alphas[k] > self.alphas[0]
    }

    /// f·|cos θi| at every level that roughens the vertex, and p₀ per steradian; `own_pdf` is the density at α.
    #[inline]
    fn evaluate(&self, query: &LobeQuery, own_pdf: f32) -> (Values<N>, f32) {
        let mut values = [Rgb::ZERO; N];
        let mut dg1 = 0.0;
        for k in 1..N {
            if !self.roughens(k) {
                continue;
            }
            // Levels coincide where a factor reaches 1.
            if self.alphas[k] == self.alphas[k - 1] {
                values[k] = values[k - 1];
                continue;
            }
            let shape = query.shape(self.alphas[k]);
            values[k] = query.base + query.scale * shape.dg2;
            dg1 += self.shares[k] * shape.dg1;
        }
        (values, own_pdf + query.pdf_scale * dg1)
    }

    /// Values in the mixture form for radiance that the light sample finds with density `pdf_light`.
    #[inline]
    fn contribution(&self, query: &LobeQuery, radiance: Rgb, pdf_light: f32) -> Values<N> {
        let (mut values, p0) = self.evaluate(query, query.pdf(self.alphas[0]));
        let weight = 1.0 / (pdf_light + p0);
        for value in &mut values[1..] {
            *value = radiance * *value * weight;
        }
        values
    }
}

/// A vertex that some level roughens.
pub(super) struct RoughenedVertex<'a, const N: usize> {
    point: &'a ShadingPoint<'a>,
    lobe: LevelLobe<N>,
    /// Levels whose lobes are drawn from, the roughest first.
    proposals: [u8; N],
    len: usize,
    /// True if the diffuse lobe was drawn: that draw is the continuation, and no other lobe is drawn from.
    diffuse: bool,
    continues: bool,
}

impl<'a, const N: usize> RoughenedVertex<'a, N> {
    /// Vertex of these α′, α at level 0 and beyond the last level, from which the path continues by the draw `next`.
    #[inline]
    pub(super) fn new(
        point: &'a ShadingPoint<'a>,
        alphas: &[f32; N],
        next: Option<&BsdfSample>,
    ) -> Self {
        let mut lobe = LevelLobe {
            alphas: *alphas,
            shares: [0.0; N],
        };
        let mut proposals = [0; N];
        let (mut len, mut above) = (0, f32::INFINITY);
        // The continuation is a draw at α, unless that is a delta.
        let floor = if alphas[0] < DELTA_ALPHA {
            0.0
        } else {
            alphas[0] * SPACING
        };
        for k in (1..N).rev() {
            // Of levels that coincide, only the first is evaluated.
            if alphas[k] == alphas[k - 1] {
                continue;
            }
            if alphas[k] > floor && alphas[k] * SPACING <= above {
                proposals[len] = k as u8;
                above = alphas[k];
                len += 1;
            }
        }
        if let [others @ .., sharpest] = &proposals[..len] {
            lobe.shares[usize::from(*sharpest)] = 1.0;
            if let Some(k) = others.last() {
                lobe.shares[usize::from(*k)] = 0.5;
            }
        }
        Self {
            point,
            lobe,
            proposals,
            len,
            diffuse: next.is_some_and(|sample| sample.lobe == Lobe::Diffuse),
            continues: next.is_some_and(|sample| !sample.delta),
        }
    }

    /// Adds the contribution of one light sample at every level. Returns the light that plain path tracing cannot find,
    /// from the least roughened level that finds it.
    #[inline]
    pub(super) fn direct_light(&self, u: LightU, total: &mut Values<N>) -> Rgb {
        let point = self.point;
        let light = point.scene.lights().sample(point.surface.position, u);
        let Some(light) = &light else {
            return Rgb::ZERO;
        };
        let Some(wi) = point.direction_to(light) else {
            return Rgb::ZERO;
        };
        let query = point.bsdf.query(point.wo, wi);
        let Some(query) = &query else {
            return Rgb::ZERO;
        };
        let plain = query.at(point.alpha);
        let (values, p0) = self.lobe.evaluate(query, plain.pdf_w);
        let dark = plain.value == Rgb::ZERO && values.iter().all(|v| *v == Rgb::ZERO);
        if dark {
            return Rgb::ZERO;
        }
        let Some(radiance) = point.radiance_of(light) else {
            return Rgb::ZERO;
        };
        let density = light.density.value();
        // The same operations as in `ShadingPoint::direct_light`, for equal bits.
        let weight = light.density.mis_weight(plain.pdf_w);
        let smooth = plain.value;
        let plain = radiance * smooth * (weight / density);
        let (weight, unseen) = if light.density.is_delta() {
            // No path of plain path tracing reaches a light without area by a Dirac lobe.
            let first = (1..N).find(|&k| self.lobe.roughens(k));
            let found = first.filter(|_| point.alpha < DELTA_ALPHA);
            let unseen = found.map_or(Rgb::ZERO, |k| radiance * (values[k] - smooth) / density);
            (1.0 / density, unseen)
        } else {
            (1.0 / (density + p0), Rgb::ZERO)
        };
        for (k, t) in total.iter_mut().enumerate() {
            *t += if self.lobe.roughens(k) {
                radiance * values[k] * weight
            } else if k > 0 {
                plain + unseen
            } else {
                plain
            };
        }
        unseen
    }

    /// Adds the emission found by separate rays drawn from the lobes, at the levels that roughen the vertex.
    #[inline]
    pub(super) fn lobe_light(&self, turn: u32, u: [f32; 3], total: &mut Values<N>) {
        let point = self.point;
        let [others @ .., sharpest] = &self.proposals[..self.len] else {
            return;
        };
        if self.diffuse {
            return;
        }
        let second = others.last().filter(|_| turn.is_multiple_of(2));
        let drawn = std::iter::once(sharpest).chain(second);
        for (i, &k) in drawn.enumerate() {
            let steps = (i + usize::from(self.continues)) as f32;
            // The fraction of a number from 0 to 4; `f32::fract` compiles to a call.
            let fraction = |x: f32| x - (x as i32) as f32;
            let rotate = |u: f32, step: f32| fraction(u + steps * step);
            let u = [u[0], rotate(u[1], ROTATION[0]), rotate(u[2], ROTATION[1])];
            let alpha = self.lobe.alphas[usize::from(k)];
            let Some((local, lobe)) = point.bsdf.direction(alpha, point.wo, u) else {
                continue;
            };
            // The continuation was drawn from the diffuse lobe too, towards the wrong side of the surface.
            if lobe == Lobe::Diffuse {
                return;
            }
            if point.passes(local) {
                continue;
            }
            let Some(wi) = point.world(local).filter(|wi| !point.is_dark(*wi)) else {
                continue;
            };
            let Some((emission, transmittance)) = point.emission_towards(wi) else {
                continue;
            };
            let Some(query) = point.bsdf.query(point.wo, local) else {
                continue;
            };
            let radiance = point.throughput * emission.radiance * transmittance;
            let values = self.lobe.contribution(&query, radiance, emission.pdf_w);
            for (t, value) in total.iter_mut().zip(values).skip(1) {
                *t += value;
            }
        }
    }

    /// Stores the weight of emission at the end of the continuation at the levels that roughen the vertex. A path that
    /// continues by a Dirac lobe finds none.
    #[inline(always)]
    pub(super) fn leave(&self, next: Option<&BsdfSample>, pending: &mut PendingLevels<N>) {
        pending.is_roughened = true;
        let roughened = &mut pending.roughened;
        roughened.lobe = self.lobe;
        roughened.throughput = self.point.throughput;
        roughened.counts = false;
        if let Some(sample) = next.filter(|_| self.continues) {
            roughened.counts = true;
            roughened.bsdf = *self.point.bsdf;
            roughened.wo = self.point.wo;
            roughened.wi = sample.wi;
        }
    }
}

/// Weights of emission at the end of the current ray at all levels.
pub(super) struct PendingLevels<const N: usize> {
    /// Weight of plain path tracing, for the levels that did not roughen the previous vertex.
    pub(super) plain: EmissionWeight,
    /// True if some level roughened the previous vertex.
    pub(super) is_roughened: bool,
    /// Weights of the levels that did. Updated in place: the struct is large, and few rays hit a light.
    roughened: RoughenedEmission<N>,
}

impl<const N: usize> PendingLevels<N> {
    /// Emission that counts in full at all levels.
    pub(super) fn full() -> Self {
        Self {
            plain: EmissionWeight::full(Rgb::ONE),
            is_roughened: false,
            roughened: RoughenedEmission {
                lobe: LevelLobe {
                    alphas: [0.0; N],
                    shares: [0.0; N],
                },
                counts: false,
                bsdf: Bsdf::BLACK,
                wo: Vec3::Z,
                wi: Vec3::Z,
                throughput: Rgb::ZERO,
            },
        }
    }

    /// The weights at the levels that roughened the previous vertex, if any did.
    #[inline]
    pub(super) fn roughened(&self) -> Option<&RoughenedEmission<N>> {
        self.is_roughened.then_some(&self.roughened)
    }
}

impl<const N: usize> PendingWeight for PendingLevels<N> {
    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.plain.scale(factor);
        self.roughened.throughput *= factor;
    }

    #[inline]
    fn is_zero(&self) -> bool {
        self.plain.is_zero() && !(self.is_roughened && self.roughened.counts)
    }
}

/// Weight of emission at the end of the current ray at the levels that roughened the previous vertex.
pub(super) struct RoughenedEmission<const N: usize> {
    lobe: LevelLobe<N>,
    /// False if no emission counts: the fields below are then those of an earlier vertex.
    counts: bool,
    /// BSDF, wo and wi of the continuation. Only the few rays that hit a light need the query.
    bsdf: Bsdf,
    wo: Vec3,
    wi: Vec3,
    /// Throughput before the vertex.
    throughput: Rgb,
}

impl<const N: usize> RoughenedEmission<N> {
    /// True if the vertex was roughened at a level.
    #[inline]
    pub(super) fn roughens(&self, k: usize) -> bool {
        self.lobe.roughens(k)
    }

    /// Values for this emitted radiance, which light sampling would find with density `pdf_light`.
    #[inline]
    pub(super) fn contribution(&self, radiance: Rgb, pdf_light: f32) -> Values<N> {
        let query = self.counts.then(|| self.bsdf.query(self.wo, self.wi));
        query.flatten().map_or([Rgb::ZERO; N], |query| {
            self.lobe
                .contribution(&query, self.throughput * radiance, pdf_light)
        })
    }
}
