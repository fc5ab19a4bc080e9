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

use super::observer::{Event, PathObserver, Technique, Vertex};
use crate::bsdf::{Bsdf, BsdfSample, DELTA_ALPHA, Lobe, LobeQuery};
use crate::math::measure::balance;
use crate::math::{Ray, Rgb, Vec3};
use crate::regularise::{Regulariser, Scattered};
use crate::sampler::{Sampler, VertexU};
use crate::scene::{LightSample, Scene, Surface};

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

/// How the emission at the end of the current ray counts.
#[derive(Clone, Copy)]
struct Arrival {
    /// Throughput for the emission: that of the path, unless the closure at α′ differs from the one at α. Zero
    /// where a regularised sample has counted the emission already.
    throughput: Rgb,
    /// Density of the direction in the closure at α′, to weigh it against light sampling; `None` for camera rays and
    /// Dirac lobes, which count in full.
    pdf_w: Option<f32>,
    /// What an observer is told if the ray meets an emitter, without its light.
    event: Option<Event>,
}

/// Bodies the path is inside of, innermost last; only scenes with absorbing bodies use it.
#[derive(Clone, Copy, Default)]
struct Medium {
    materials: [u32; 4],
    len: usize,
}

impl Medium {
    fn enter(&mut self, material: u32) {
        if self.len < self.materials.len() {
            self.materials[self.len] = material;
            self.len += 1;
        }
    }

    fn leave(&mut self, material: u32) {
        if let Some(i) = self.materials[..self.len]
            .iter()
            .rposition(|&m| m == material)
        {
            self.materials.copy_within(i + 1..self.len, i);
            self.len -= 1;
        }
    }

    /// Transmittance over a distance inside the innermost body (Beer-Lambert).
    fn transmittance(&self, scene: &Scene, distance: f32) -> Rgb {
        let Some(&material) = self.materials[..self.len].last() else {
            return Rgb::ONE;
        };
        let sigma = scene.parts().materials[material as usize].absorption;
        // 0 · ∞ is no absorption over any distance.
        sigma.map(|s| if s > 0.0 { (-s * distance).exp() } else { 1.0 })
    }
}

/// A vertex as the steps of the loop need it.
struct Here<'a> {
    scene: &'a Scene,
    surface: Surface,
    bsdf: Bsdf,
    /// Local direction towards the previous vertex.
    wo: Vec3,
    /// Own roughness.
    alpha: f32,
    /// Roughness at next-event estimation.
    alpha_reg: f32,
    throughput: Rgb,
    medium: Medium,
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
                        scene.environment(ray.dir),
                        || scene.pdf_environment(ray.dir),
                        observer,
                    );
                }
                break;
            };
            let surface = scene.surface(&ray, &hit);
            if medium.len > 0 {
                let transmittance = medium.transmittance(scene, hit.t);
                throughput *= transmittance;
                arrival.scale(transmittance);
            }

            // ── emission met by the ray
            let radiance = scene.emitted(&surface, -ray.dir);
            if radiance != Rgb::ZERO && arrival.throughput != Rgb::ZERO {
                total += arrival.weigh(
                    radiance,
                    || scene.pdf_emitter(ray.origin, &surface),
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
            let here = Here {
                scene,
                surface,
                bsdf,
                wo: surface.frame.to_local(-ray.dir),
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

impl Arrival {
    const COUNTED: Self = Self {
        throughput: Rgb::ZERO,
        pdf_w: None,
        event: None,
    };

    /// Emission counts in full.
    fn full(throughput: Rgb) -> Self {
        Self {
            throughput,
            ..Self::COUNTED
        }
    }

    /// Whether no emission at the end of the ray would count, at any roughness.
    #[inline]
    fn carries_nothing(&self) -> bool {
        self.throughput == Rgb::ZERO && self.event.is_none()
    }

    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.throughput *= factor;
        if let Some(event) = &mut self.event {
            event.radiance *= factor;
        }
    }

    /// What emitted radiance contributes; tells the observer of an event.
    #[inline]
    fn weigh<O: PathObserver>(
        &self,
        radiance: Rgb,
        pdf_light: impl FnOnce() -> f32,
        observer: &mut O,
    ) -> Rgb {
        let Some(pdf_w) = self.pdf_w else {
            return self.throughput * radiance;
        };
        let pdf_light = pdf_light();
        if O::EVENTS
            && let Some(event) = self.event
        {
            observer.event(&Event {
                radiance: event.radiance * radiance,
                pdf_light,
                ..event
            });
        }
        self.throughput * radiance * balance(pdf_w, pdf_light)
    }
}

/// Where a path goes on.
struct Next {
    /// World direction.
    wi: Vec3,
    sample: BsdfSample,
    arrival: Arrival,
}

impl Here<'_> {
    /// Whether the table has a say in this vertex.
    #[inline]
    fn is_regularised(&self) -> bool {
        self.alpha_reg > self.alpha
    }

    /// World direction of a local one; `None` where shading and geometric normal disagree about its side.
    #[inline]
    fn world(&self, wi: Vec3) -> Option<Vec3> {
        let world = self.surface.frame.to_world(wi);
        (world.dot(self.surface.ng) * wi.z > 0.0).then_some(world)
    }

    /// An event of this vertex; `radiance` is a factor that the light's radiance multiplies.
    fn event(&self, query: LobeQuery, radiance: Rgb, technique: Technique) -> Event {
        Event {
            query,
            radiance,
            pdf_light: 0.0,
            delta_light: false,
            technique,
            alpha: self.alpha,
            alpha_reg: self.alpha_reg,
        }
    }

    /// Step 1: a light sample, the closure at α′.
    #[inline]
    fn sample_light<O: PathObserver>(&self, u: [f32; 3], observer: &mut O) -> Rgb {
        if self.bsdf.is_delta_at(self.alpha_reg) {
            return Rgb::ZERO;
        }
        let Some(light) = self.scene.sample_light(self.surface.position, u) else {
            return Rgb::ZERO;
        };
        let wi = self.surface.frame.to_local(light.wi);
        if light.wi.dot(self.surface.ng) * wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let Some(query) = self.bsdf.query(self.wo, wi) else {
            return Rgb::ZERO;
        };
        let eval = query.at(self.alpha_reg);
        // A recorder wants the events that are dark at this roughness too: at another they are not.
        let dark = eval.value == Rgb::ZERO && !(O::EVENTS && self.is_regularised());
        if dark || self.scene.occluded(&self.surface.spawn_to_light(&light)) {
            return Rgb::ZERO;
        }
        let radiance =
            self.throughput * light.radiance * self.transmittance(light.wi, light.distance);
        if O::EVENTS && self.is_regularised() {
            let LightSample { pdf_w, delta, .. } = light;
            observer.event(&Event {
                pdf_light: pdf_w,
                delta_light: delta,
                ..self.event(query, radiance, Technique::Light)
            });
        }
        let weight = if light.delta {
            1.0
        } else {
            balance(light.pdf_w, eval.pdf_w)
        };
        radiance * eval.value * (weight / light.pdf_w)
    }

    /// The bodies that a ray from here along the world direction `wi` is inside of.
    #[inline]
    fn medium_towards(&self, wi: Vec3) -> Medium {
        let mut medium = self.medium;
        let outside = self.wo.z > 0.0;
        if self.scene.has_absorption()
            && self.bsdf.is_solid()
            && (wi.dot(self.surface.ng) > 0.0) != outside
        {
            if outside {
                medium.enter(self.surface.material)
            } else {
                medium.leave(self.surface.material)
            }
        }
        medium
    }

    /// Transmittance from here along the world direction `wi`.
    #[inline]
    fn transmittance(&self, wi: Vec3, distance: f32) -> Rgb {
        if self.scene.has_absorption() {
            self.medium_towards(wi).transmittance(self.scene, distance)
        } else {
            Rgb::ONE
        }
    }

    /// Steps 2 and 3: emission found by a regularised ray of its own, and the way on.
    #[inline]
    fn scatter<R: Regulariser, O: PathObserver>(
        &self,
        u: &VertexU,
        observer: &mut O,
    ) -> (Rgb, Option<Next>) {
        let regularised = R::ACTIVE && self.is_regularised();
        let alpha = if R::REUSE { self.alpha_reg } else { self.alpha };
        let on = self
            .bsdf
            .sample(alpha, self.wo, u.lobe)
            .and_then(|sample| Some((self.world(sample.wi)?, sample)));
        // One ray serves both where the path goes on with the closure at α′, or with the diffuse lobe.
        let shared = |sample: &BsdfSample| !regularised || R::REUSE || sample.lobe == Lobe::Diffuse;
        match on {
            Some((wi, sample)) if shared(&sample) => {
                let arrival = if sample.delta {
                    Arrival::full(self.throughput * sample.weight)
                } else if regularised {
                    self.shared_arrival::<O>(&sample)
                } else {
                    Arrival {
                        throughput: self.throughput * sample.weight,
                        pdf_w: Some(sample.pdf_w),
                        event: None,
                    }
                };
                (
                    Rgb::ZERO,
                    Some(Next {
                        wi,
                        sample,
                        arrival,
                    }),
                )
            }
            on => {
                let found = if regularised {
                    self.regularised_emission(u.lobe, observer)
                } else {
                    Rgb::ZERO
                };
                (
                    found,
                    on.map(|(wi, sample)| Next {
                        wi,
                        sample,
                        arrival: Arrival::COUNTED,
                    }),
                )
            }
        }
    }

    /// How emission counts at the end of a ray whose direction is a draw from the closure at α′ as much as from
    /// the one at which the path goes on.
    #[inline]
    fn shared_arrival<O: PathObserver>(&self, sample: &BsdfSample) -> Arrival {
        let Some(query) = self.bsdf.query(self.wo, sample.wi) else {
            return Arrival::COUNTED;
        };
        let eval = query.at(self.alpha_reg);
        if eval.pdf_w <= 0.0 {
            return Arrival::COUNTED;
        }
        let event = O::EVENTS.then(|| self.event(query, self.throughput, Technique::Lobe));
        Arrival {
            throughput: self.throughput * eval.value / eval.pdf_w,
            pdf_w: Some(eval.pdf_w),
            event,
        }
    }

    /// Step 2 with a ray of its own: emission that a direction drawn at α′ finds.
    #[inline]
    fn regularised_emission<O: PathObserver>(&self, u: [f32; 3], observer: &mut O) -> Rgb {
        let Some(sample) = self.bsdf.sample(self.alpha_reg, self.wo, u) else {
            return Rgb::ZERO;
        };
        let Some(wi) = self.world(sample.wi) else {
            return Rgb::ZERO;
        };
        let Some(emission) = self.scene.emission_along(&self.surface.spawn(wi)) else {
            return Rgb::ZERO;
        };
        let radiance =
            self.throughput * emission.radiance * self.transmittance(wi, emission.distance);
        if O::EVENTS
            && let Some(query) = self.bsdf.query(self.wo, sample.wi)
        {
            observer.event(&Event {
                pdf_light: emission.pdf_w,
                ..self.event(query, radiance, Technique::Lobe)
            });
        }
        // Only an interface between equal indices is a delta at any roughness; light sampling cannot see through it.
        let weight = if sample.delta {
            1.0
        } else {
            balance(sample.pdf_w, emission.pdf_w)
        };
        radiance * sample.weight * weight
    }
}
