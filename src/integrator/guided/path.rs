//! The guided path: the loop of the path tracer, with directions drawn from the BSDF or the guide.

use super::field::{Field, Leaf, Record};
use crate::bsdf::{BsdfSample, Lobe, SharedNumbers};
use crate::integrator::walk::bodies::EnclosingBodies;
use crate::integrator::walk::dispersion::Channel;
use crate::integrator::walk::observer::PathObserver;
use crate::integrator::walk::pending_emission::PendingEmission;
use crate::integrator::walk::roughening::{remember, roughen};
use crate::integrator::walk::roulette;
use crate::integrator::walk::shading_point::{Continuation, ShadingPoint};
use crate::math::{Ray, Rgb, Vec2, Vec3, luminance};
use crate::regularise::Roughening;
use crate::sampler::Sampler;
use crate::scene::Scene;

/// Roughness below which a lobe is not guided: where it is sharp its own density is better than any quadtree, and in chains
/// of such lobes every draw that misses them costs a factor.
const SHARP: f32 = 0.3;

/// The density from which a vertex draws the next direction: that of the BSDF, and where the guide knows something, a
/// mixture of both.
#[derive(Clone, Copy)]
struct Mixture<'a> {
    region: Option<&'a Leaf>,
    /// Probability of a draw from the BSDF.
    share: f32,
}

impl Mixture<'_> {
    /// Density of a world direction, whose density in the BSDF is `pdf_w`.
    #[inline]
    fn pdf(&self, wi: Vec3, pdf_w: f32) -> f32 {
        match self.region {
            Some(region) if self.share < 1.0 => {
                self.share * pdf_w + (1.0 - self.share) * region.tree.pdf(wi)
            }
            _ => pdf_w,
        }
    }

    /// Draws a direction; also its density in the BSDF, and in the tree.
    #[inline]
    fn sample(
        &self,
        point: &ShadingPoint<'_>,
        lobe: &SharedNumbers,
        u: [f32; 4],
    ) -> Option<(Continuation, [f32; 2])> {
        let Some(region) = self.region else {
            let next = point.sample(point.alpha, lobe)?;
            let pdf_w = next.sample.pdf_w;
            return Some((next, [pdf_w, 0.0]));
        };
        let (next, tree) = if u[0] < self.share {
            let next = point.sample(point.alpha, lobe)?;
            if next.sample.delta {
                let mut sample = next.sample;
                sample.weight /= self.share;
                return Some((Continuation { sample, ..next }, [0.0; 2]));
            }
            let tree = region.tree.pdf(next.wi);
            (next, tree)
        } else {
            let (dir, pdf) = region.tree.sample(Vec2::new(u[1], u[2]));
            let wi = point.frame.to_local(dir);
            if dir.dot(point.surface.ng) * wi.z <= 0.0 {
                return None;
            }
            let query = point.bsdf.query(point.wo, wi)?;
            let eval = query.at(point.alpha);
            // The lobe from which the BSDF would have drawn the direction, with the same probability.
            let lobe = if u[3] * eval.pdf_w < query.base_pdf {
                Lobe::Diffuse
            } else if wi.z * point.wo.z > 0.0 {
                Lobe::Reflection
            } else {
                Lobe::Transmission
            };
            let sample = BsdfSample {
                wi,
                value: eval.value,
                weight: Rgb::ZERO,
                pdf_w: eval.pdf_w,
                lobe,
                delta: false,
            };
            (Continuation { wi: dir, sample }, pdf)
        };
        let mut sample = next.sample;
        let pdfs = [sample.pdf_w, tree];
        sample.pdf_w = self.share * sample.pdf_w + (1.0 - self.share) * tree;
        if sample.pdf_w <= 0.0 || sample.value == Rgb::ZERO {
            return None;
        }
        sample.weight = sample.value / sample.pdf_w;
        Some((Continuation { sample, ..next }, pdfs))
    }
}

/// A vertex whose record is open until the path is complete.
struct OpenRecord {
    record: Record,
    /// Density of the direction.
    pdf_w: f32,
    weight: Rgb,
    /// Throughput beyond the vertex.
    throughput: Rgb,
    /// Contributions found beyond it, before the next record.
    found: Rgb,
}

/// Training samples of the guide from the paths of a tile.
#[derive(Default)]
pub(super) struct TrainingSamples {
    pub(super) records: Vec<Record>,
    path: Vec<OpenRecord>,
}

impl TrainingSamples {
    /// Adds a contribution to all open records.
    fn found(&mut self, value: Rgb) {
        if let Some(last) = self.path.last_mut() {
            last.found += value;
        }
    }

    /// Closes the records of a path.
    fn finish(&mut self) {
        let mut beyond = Rgb::ZERO;
        while let Some(open) = self.path.pop() {
            beyond += open.found;
            let radiance = Rgb::select(
                open.throughput.cmpgt(Rgb::ZERO),
                beyond / open.throughput,
                Rgb::ZERO,
            );
            let mut record = open.record;
            record.value = luminance(radiance) / open.pdf_w;
            record.scattered = luminance(radiance * open.weight);
            if record.value.is_finite() && record.scattered.is_finite() {
                self.records.push(record);
            }
        }
    }
}

/// A path tracer that draws directions from a guide too.
#[derive(Clone, Copy, Debug)]
pub(super) struct GuidedTracer<R> {
    /// Scattering vertices of the longest path, at least 1.
    pub(super) max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette begins.
    pub(super) roulette_start: u32,
    /// The rule that roughens the last vertex.
    pub(super) rule: R,
    /// The guide alone learns from roughened vertices: the picture is plain.
    pub(super) unbiased: bool,
}

impl<R: Roughening> GuidedTracer<R> {
    /// Radiance that arrives along a camera ray, as [`PathTracer::radiance`](crate::integrator::PathTracer::radiance); the
    /// path is recorded where there are training samples.
    #[expect(
        clippy::too_many_arguments,
        reason = "a path tracer's, the guide and its training samples"
    )]
    pub(super) fn radiance<S: Sampler, O: PathObserver>(
        &self,
        scene: &Scene,
        mut ray: Ray,
        mut bodies: EnclosingBodies,
        sample: u32,
        field: &Field,
        mut training: Option<&mut TrainingSamples>,
        sampler: &mut S,
        observer: &mut O,
    ) -> Rgb {
        let mut total = Rgb::ZERO;
        let mut throughput = Rgb::ONE;
        let mut channel = Channel::default();
        let mut eta_scale = 1.0f32;
        let mut memory = self.rule.start(sample);
        let mut emission = PendingEmission::full(Rgb::ONE);
        // False where the emission that the current ray meets is recorded already, by a roughened lobe.
        let mut records_emission = true;
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
                    if let Some(training) = training.as_deref_mut().filter(|_| records_emission) {
                        training.found(found);
                    }
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
                if let Some(training) = training.as_deref_mut().filter(|_| records_emission) {
                    training.found(found);
                }
            }
            if n > self.max_vertices {
                break;
            }

            // ── the vertex
            let u = sampler.vertex();
            let lobe = SharedNumbers::new(u.lobe);
            let v: [f32; 4] = std::array::from_fn(|_| sampler.next_1d());
            let mut bsdf = channel.bsdf(scene, &mut surface, u.material, &mut throughput);
            bodies.interface(scene, &mut surface, ray.dir, &mut bsdf);
            let alpha = bsdf.alpha();
            let frame = surface.frame_for(-ray.dir);
            let alpha_reg = roughen(&self.rule, &memory, alpha);
            let point = ShadingPoint {
                scene,
                surface: &surface,
                frame,
                bsdf: &bsdf,
                wo: frame.to_local(-ray.dir),
                alpha,
                alpha_reg: if self.unbiased { alpha } else { alpha_reg },
                throughput,
                bodies: &bodies,
            };
            observer.vertex(n, hit.t, &point);
            // Without its glossy lobe a surface with a base is no Dirac delta.
            let guided = alpha >= SHARP && !bsdf.is_delta_at(alpha) || !bsdf.is_delta_at(0.0);
            let (leaf, edges) = if guided {
                field.leaf(surface.position)
            } else {
                (0, Vec3::ZERO)
            };
            let region = field.region(leaf);
            let class = u8::from(!bsdf.is_diffuse());
            let share = region.shares[usize::from(class)];
            // A tree that no direction is drawn from is asked for its density by training samples alone.
            let asked = guided && (share < 1.0 || training.is_some());
            let mixture = Mixture {
                region: (asked && !region.tree.is_empty()).then_some(region),
                share,
            };

            // ── light of the roughened vertex that only the guide learns from
            let roughened_training = R::ACTIVE && self.unbiased && alpha_reg > alpha;
            if roughened_training && let Some(training) = training.as_deref_mut() {
                let rough = ShadingPoint { alpha_reg, ..point };
                training.found(rough.direct_light(u.light, &mut ()));
                training.found(rough.roughened_emission(&lobe, &mut ()));
            }

            // ── next-event estimation
            let roughened = R::ACTIVE && point.is_roughened();
            let mut direct = if roughened {
                point.direct_light(u.light, observer)
            } else {
                point.direct_light_among(u.light, observer, |wi, pdf_w| mixture.pdf(wi, pdf_w))
            };
            observer.light(n, direct);
            if roughened {
                let found = point.roughened_emission(&lobe, observer);
                observer.light(n, found);
                direct += found;
            }
            total += direct;
            if let Some(training) = training.as_deref_mut().filter(|_| !roughened_training) {
                training.found(direct);
            }

            // ── the continuation, and emission found by it
            let Some((next, pdfs)) = mixture.sample(&point, &lobe, v) else {
                break;
            };
            emission = if roughened {
                PendingEmission::COUNTED
            } else {
                point.shared_emission::<O>(&next.sample, false, false)
            };
            records_emission = !roughened_training;
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
            if let Some(training) = training
                .as_deref_mut()
                .filter(|_| guided && !next.sample.delta)
            {
                let jitter = Vec3::from_array(std::array::from_fn(|_| sampler.next_1d() - 0.5));
                let turn = Vec2::new(sampler.next_1d() - 0.5, sampler.next_1d() - 0.5);
                let (leaf, at) = field.blurred(surface.position, edges * jitter, next.wi, turn);
                training.path.push(OpenRecord {
                    record: Record {
                        leaf,
                        at,
                        value: 0.0,
                        scattered: 0.0,
                        pdfs,
                        class,
                    },
                    pdf_w: next.sample.pdf_w,
                    weight: next.sample.weight,
                    throughput,
                    found: Rgb::ZERO,
                });
            }
            ray = surface.spawn(next.wi);
        }
        if let Some(training) = training {
            training.finish();
        }
        observer.finish(total);
        total
    }
}
