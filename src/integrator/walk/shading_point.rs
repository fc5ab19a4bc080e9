//! One vertex of a path: light sampled from it, emission that a regularised lobe finds, and the way on.

use super::bodies::Medium;
use super::pending_emission::Arrival;
use crate::bsdf::{Bsdf, BsdfSample, Lobe, LobeQuery};
use crate::integrator::walk::observer::{Event, PathObserver, Technique};
use crate::math::measure::balance;
use crate::math::{Frame, Rgb, Vec3};
use crate::regularise::Regulariser;
use crate::sampler::VertexU;
use crate::scene::{Scene, Surface};

/// A vertex as the steps of the loop need it.
pub(in crate::integrator) struct Here<'a> {
    pub(in crate::integrator) scene: &'a Scene,
    pub(in crate::integrator) surface: Surface,
    /// Shading frame for the direction towards the previous vertex.
    pub(in crate::integrator) frame: Frame,
    pub(in crate::integrator) bsdf: Bsdf,
    /// Local direction towards the previous vertex.
    pub(in crate::integrator) wo: Vec3,
    /// Own roughness.
    pub(in crate::integrator) alpha: f32,
    /// Roughness at next-event estimation.
    pub(in crate::integrator) alpha_reg: f32,
    pub(in crate::integrator) throughput: Rgb,
    pub(in crate::integrator) medium: Medium,
}

/// Where a path goes on.
pub(in crate::integrator) struct Next {
    /// World direction.
    pub(in crate::integrator) wi: Vec3,
    pub(in crate::integrator) sample: BsdfSample,
    pub(in crate::integrator) arrival: Arrival,
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
        let world = self.frame.to_world(wi);
        (world.dot(self.surface.ng) * wi.z > 0.0).then_some(world)
    }

    /// An event of this vertex; `radiance` is a factor that the light's radiance multiplies.
    #[inline]
    fn event(&self, query: LobeQuery, radiance: Rgb, technique: Technique) -> Event {
        Event {
            query,
            radiance,
            pdf_light: 0.0,
            delta_light: false,
            technique,
            counted: true,
            alpha: self.alpha,
            alpha_reg: self.alpha_reg,
        }
    }

    /// Step 1: a light sample, the closure at α′.
    #[inline]
    pub(in crate::integrator) fn sample_light<O: PathObserver>(
        &self,
        u: [f32; 3],
        observer: &mut O,
    ) -> Rgb {
        if self.bsdf.is_delta_at(self.alpha_reg) {
            return Rgb::ZERO;
        }
        let Some(light) = self.scene.lights().sample(self.surface.position, u) else {
            return Rgb::ZERO;
        };
        let wi = self.frame.to_local(light.wi);
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
            observer.event(&Event {
                pdf_light: light.density.value(),
                delta_light: light.density.is_delta(),
                ..self.event(query, radiance, Technique::Light)
            });
        }
        let weight = light.density.mis_weight(eval.pdf_w);
        radiance * eval.value * (weight / light.density.value())
    }

    /// The bodies that a ray from here along the world direction `wi` is inside of.
    #[inline]
    pub(in crate::integrator) fn medium_towards(&self, wi: Vec3) -> Medium {
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
    pub(in crate::integrator) fn transmittance(&self, wi: Vec3, distance: f32) -> Rgb {
        if self.scene.has_absorption() {
            self.medium_towards(wi).transmittance(self.scene, distance)
        } else {
            Rgb::ONE
        }
    }

    /// Steps 2 and 3: emission found by a regularised ray of its own, and the way on.
    #[inline]
    pub(in crate::integrator) fn scatter<R: Regulariser, O: PathObserver>(
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
                let mut found = Rgb::ZERO;
                if regularised {
                    found = self.regularised_emission(self.alpha_reg, u.lobe, true, observer);
                    self.further_draws(u.lobe, observer);
                }
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
        let event = O::EVENTS.then(|| self.event(query, self.throughput, Technique::Diffuse));
        Arrival {
            throughput: self.throughput * eval.value / eval.pdf_w,
            pdf_w: Some(eval.pdf_w),
            event,
        }
    }

    /// Events of the lobe at the roughness that an observer asks for.
    #[inline]
    fn further_draws<O: PathObserver>(&self, u: [f32; 3], observer: &mut O) {
        if O::EVENTS {
            for alpha in observer.draws(self.alpha) {
                self.regularised_emission(alpha, u, false, observer);
            }
        }
    }

    /// Step 2 with a ray of its own: emission that a direction drawn at the roughness `alpha` finds.
    #[inline]
    fn regularised_emission<O: PathObserver>(
        &self,
        alpha: f32,
        u: [f32; 3],
        counted: bool,
        observer: &mut O,
    ) -> Rgb {
        let Some(sample) = self.bsdf.sample(alpha, self.wo, u) else {
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
                counted,
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
