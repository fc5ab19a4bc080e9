//! One vertex of a path: light sampled from it, emission found by its roughened lobe, and the continuation.

use super::bodies::EnclosingBodies as Surroundings;
use super::observer::{Event, PathObserver, Technique};
use super::pending_emission::{EmissionWeight, HitEmission, PendingWeight};
use crate::bsdf::{Bsdf, BsdfEval, BsdfSample, Lobe, LobeNumbers, LobeQuery, SharedNumbers};
use crate::math::measure::balance;
use crate::math::{Frame, Ray, Rgb, Vec3};
use crate::sampler::LightU;
use crate::scene::{Emission, LightSample, Scene, Surface};

/// A scattering vertex. Its larger fields are borrowed: a copy at every vertex is slow.
pub struct ShadingPoint<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The surface point.
    pub surface: &'a Surface,
    /// Shading frame for the direction towards the previous vertex.
    pub frame: Frame,
    /// Its BSDF.
    pub bsdf: &'a Bsdf,
    /// Local direction towards the previous vertex.
    pub wo: Vec3,
    /// The BSDF's own roughness α.
    pub alpha: f32,
    /// Roughness α′ ≥ `alpha` at next-event estimation.
    pub alpha_reg: f32,
    /// Throughput of the path before this vertex.
    pub throughput: Rgb,
    /// Media around the previous edge.
    pub(in crate::integrator) around: &'a Surroundings,
    /// Vertices still allowed on the path: the most panes between here and a light.
    pub(in crate::integrator) panes: u32,
}

/// The ray on which a path continues.
pub(in crate::integrator) struct Continuation {
    /// World direction.
    pub(in crate::integrator) wi: Vec3,
    pub(in crate::integrator) sample: BsdfSample,
}

/// Emission at the end of a direction that was drawn from a lobe.
struct FoundEmission {
    sample: BsdfSample,
    /// Throughput before the vertex, times the emitted radiance.
    radiance: Rgb,
    pdf_light: f32,
}

impl ShadingPoint<'_> {
    /// True if a rule has changed the roughness at next-event estimation.
    #[inline]
    pub(crate) fn is_roughened(&self) -> bool {
        self.alpha_reg > self.alpha
    }

    /// Reflectance of the surface; under a coat or a sheen that of the base.
    pub(in crate::integrator) fn reflectance(&self) -> Rgb {
        self.scene.reflectance(self.surface, self.bsdf)
    }

    /// World direction of a local one; `None` where shading and geometric normal disagree about its side.
    #[inline]
    pub(in crate::integrator) fn world(&self, wi: Vec3) -> Option<Vec3> {
        let world = self.frame.to_world(wi);
        self.surface.allows_direction(world, wi.z).then_some(world)
    }

    /// True where a ray along the world direction `wi` ends inside a body without light.
    #[inline]
    pub(in crate::integrator) fn is_dark(&self, wi: Vec3) -> bool {
        self.bsdf.is_solid()
            && wi.dot(self.surface.ng) < 0.0
            && self.scene.is_dark_inside(self.surface.material)
    }

    /// True at a pane. Its transmission counts at the previous vertex; only its reflection counts here.
    #[inline]
    pub(in crate::integrator) fn is_pane(&self) -> bool {
        self.scene.is_pane(self.surface) && matches!(self.bsdf, Bsdf::Thin(_))
    }

    /// True if light from `wi` passes a pane here, and so counts at the previous vertex.
    #[inline]
    pub(in crate::integrator) fn passes(&self, wi: Vec3) -> bool {
        self.wo.z * wi.z < 0.0 && self.is_pane()
    }

    /// True if a path continues straight through a pane.
    #[inline]
    pub(in crate::integrator) fn goes_straight(&self, sample: &BsdfSample) -> bool {
        sample.delta && sample.lobe == Lobe::Transmission && self.is_pane()
    }

    /// An event of this vertex towards a light with area; `radiance` is a factor that the light's radiance multiplies.
    #[inline]
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

    /// Step 1: light sampled directly, the BSDF evaluated at α′.
    #[inline]
    pub(in crate::integrator) fn direct_light<O: PathObserver>(
        &self,
        u: LightU,
        observer: &mut O,
    ) -> Rgb {
        self.direct_light_among(u, observer, |_, pdf_w| pdf_w)
    }

    /// The same with the MIS weight against a next direction of density `pdf`, a function of the world direction and of
    /// the BSDF's density.
    #[inline]
    pub(in crate::integrator) fn direct_light_among<O: PathObserver>(
        &self,
        u: LightU,
        observer: &mut O,
        pdf: impl FnOnce(Vec3, f32) -> f32,
    ) -> Rgb {
        if self.bsdf.is_delta_at(self.alpha_reg) {
            return Rgb::ZERO;
        }
        // By reference: a copy would wait for the stores of the call.
        let light = self.scene.lights().sample(self.surface.position, u);
        let Some(light) = &light else {
            return Rgb::ZERO;
        };
        let Some(wi) = self.direction_to(light) else {
            return Rgb::ZERO;
        };
        let eval = self.bsdf.eval(self.alpha_reg, self.wo, wi);
        // Events without light at this roughness are reported too: at another roughness they may have some.
        let query = if O::EVENTS && self.is_roughened() {
            self.bsdf.query(self.wo, wi)
        } else {
            None
        };
        if eval.value == Rgb::ZERO && query.is_none() {
            return Rgb::ZERO;
        }
        let Some(radiance) = self.radiance_of(light) else {
            return Rgb::ZERO;
        };
        if let Some(query) = query {
            observer.event(&Event {
                pdf_light: light.density.value(),
                delta_light: light.density.is_delta(),
                ..self.event(query, radiance, Technique::Light)
            });
        }
        let weight = light.density.mis_weight(pdf(light.wi, eval.pdf_w));
        radiance * eval.value * (weight / light.density.value())
    }

    /// Local direction towards a light sample; `None` where the vertex reflects and transmits none of its light.
    #[inline(always)]
    pub(in crate::integrator) fn direction_to(&self, light: &LightSample) -> Option<Vec3> {
        let wi = self.frame.to_local(light.wi);
        let lit = self.surface.allows_direction(light.wi, wi.z);
        (lit && !self.is_dark(light.wi) && !self.passes(wi)).then_some(wi)
    }

    /// Radiance of a light sample that arrives here, times the throughput; `None` if it is blocked.
    #[inline(always)]
    pub(in crate::integrator) fn radiance_of(&self, light: &LightSample) -> Option<Rgb> {
        let transmittance = self.transmittance_to(light)?;
        Some(self.throughput * light.radiance * transmittance)
    }

    /// The bodies around a ray from here along the world direction `wi`.
    #[inline]
    fn bodies_towards(&self, wi: Vec3) -> Surroundings {
        let outside = self.wo.z > 0.0;
        self.around
            .towards(self.scene, self.surface, self.bsdf, outside, wi)
    }

    /// Transmittance from here to a light sample; `None` if it is blocked.
    #[inline]
    pub(in crate::integrator) fn transmittance_to(&self, light: &LightSample) -> Option<Rgb> {
        let ray = self.surface.spawn_to_light(light);
        if self.scene.tracks_bodies() {
            let bodies = self.bodies_towards(light.wi);
            bodies.unblocked(self.scene, &ray, light.distance, self.panes)
        } else {
            self.scene.open_transmittance(&ray, self.panes)
        }
    }

    /// Emission seen along the world direction `wi`, and the transmittance to it.
    #[inline]
    pub(in crate::integrator) fn emission_towards(&self, wi: Vec3) -> Option<(Emission, Rgb)> {
        let ray = self.surface.spawn_leaving(wi);
        if self.scene.has_panes() {
            return self.emission_through_panes(&ray);
        }
        if !self.scene.tracks_bodies() {
            return Some((self.scene.emission_along(&ray)?, Rgb::ONE));
        }
        let mut bodies = self.bodies_towards(wi);
        if !self.scene.features().overlaps {
            let emission = self.scene.emission_along(&ray)?;
            let transmittance = bodies.transmittance(self.scene, emission.distance);
            return Some((emission, transmittance));
        }
        let segment = bodies.follow(self.scene, &ray);
        let emission = self.scene.emission_at(&ray, segment.hit)?;
        let last = bodies.transmittance(self.scene, emission.distance - segment.start);
        Some((emission, segment.passed.unwrap_or(Rgb::ONE) * last))
    }

    #[cold]
    #[inline(never)]
    fn emission_through_panes(&self, ray: &Ray) -> Option<(Emission, Rgb)> {
        let mut bodies = if self.scene.tracks_bodies() {
            self.bodies_towards(ray.dir)
        } else {
            Surroundings::default()
        };
        let (mut rest, mut passed) = (*ray, Rgb::ONE);
        for _ in 0..=self.panes {
            let segment = bodies.follow(self.scene, &rest);
            passed *= segment.passed.unwrap_or(Rgb::ONE);
            let end = segment.hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
            passed *= bodies.transmittance(self.scene, end - segment.start);
            let straight = (segment.hit.as_ref()).and_then(|hit| {
                let surface = self.scene.surface(hit);
                Some((surface, self.scene.pane_transmittance(&surface, ray.dir)?))
            });
            let Some((surface, transmittance)) = straight else {
                // With the density of light sampling from this vertex, not from the last pane.
                return Some((self.scene.emission_at(ray, segment.hit)?, passed));
            };
            passed *= transmittance;
            rest = surface.spawn(ray.dir);
        }
        None
    }

    /// Step 3: a direction drawn from the BSDF at roughness `alpha`; `None` where the path ends.
    #[inline(always)]
    pub(in crate::integrator) fn sample(
        &self,
        alpha: f32,
        u: impl LobeNumbers,
    ) -> Option<Continuation> {
        let sample = self.bsdf.sample(alpha, self.wo, u)?;
        let wi = self.world(sample.wi)?;
        Some(Continuation { wi, sample })
    }

    /// Weight of emission at the end of a continuation of a vertex that is not roughened.
    #[inline(always)]
    pub(in crate::integrator) fn own_emission(&self, sample: &BsdfSample) -> EmissionWeight {
        EmissionWeight {
            throughput: self.throughput * sample.weight,
            pdf_w: (!sample.delta).then_some(sample.pdf_w),
        }
    }

    /// Weight of emission at the end of a continuation that step 2 shares: its direction is a draw from the BSDF at α′
    /// as much as from the one at which the path continues. `reused` if the path continues at α′ itself.
    #[inline(always)]
    pub(in crate::integrator) fn shared_emission<O: PathObserver>(
        &self,
        sample: &BsdfSample,
        roughened: bool,
        reused: bool,
    ) -> PendingEmission {
        if sample.delta || !roughened {
            return PendingEmission::of(self.own_emission(sample));
        }
        let query = if O::EVENTS {
            self.bsdf.query(self.wo, sample.wi)
        } else {
            None
        };
        let BsdfEval { value, pdf_w } = if reused {
            BsdfEval {
                value: sample.value,
                pdf_w: sample.pdf_w,
            }
        } else {
            self.bsdf.eval(self.alpha_reg, self.wo, sample.wi)
        };
        if pdf_w <= 0.0 {
            return PendingEmission::COUNTED;
        }
        PendingEmission {
            weight: EmissionWeight {
                throughput: self.throughput * value / pdf_w,
                pdf_w: Some(pdf_w),
            },
            event: query.map(|query| self.event(query, self.throughput, Technique::Continuation)),
        }
    }

    /// Step 2 with a separate ray: emission at the end of a direction drawn from the BSDF at α′.
    #[inline]
    pub(in crate::integrator) fn roughened_emission<O: PathObserver>(
        &self,
        u: &SharedNumbers,
        observer: &mut O,
    ) -> Rgb {
        let found = self.find_emission(self.alpha_reg, u);
        if O::EVENTS {
            if let Some(event) = found.as_ref().and_then(|found| self.found_event(found)) {
                observer.event(&event);
            }
            observer.roughened(self, u);
        }
        let Some(found) = &found else {
            return Rgb::ZERO;
        };
        let sample = &found.sample;
        // Only an interface between equal indices is a delta at any roughness; light sampling finds nothing through it.
        let weight = if sample.delta {
            1.0
        } else {
            balance(sample.pdf_w, found.pdf_light)
        };
        found.radiance * sample.weight * weight
    }

    /// Emission at the end of a separate ray, whose direction is drawn from the lobe at roughness `alpha`.
    #[inline]
    fn find_emission(&self, alpha: f32, u: &SharedNumbers) -> Option<FoundEmission> {
        let (local, lobe) = self.bsdf.direction(alpha, self.wo, u)?;
        if self.passes(local) {
            return None;
        }
        let wi = self.world(local).filter(|wi| !self.is_dark(*wi))?;
        let (emission, transmittance) = self.emission_towards(wi)?;
        // Few rays hit a light: only those need value and density.
        let sample = self.bsdf.sample_along(alpha, self.wo, local, lobe)?;
        Some(FoundEmission {
            sample,
            radiance: self.throughput * emission.radiance * transmittance,
            pdf_light: emission.pdf_w,
        })
    }

    #[inline]
    fn found_event(&self, found: &FoundEmission) -> Option<Event> {
        let query = self.bsdf.query(self.wo, found.sample.wi)?;
        Some(Event {
            pdf_light: found.pdf_light,
            ..self.event(query, found.radiance, Technique::Lobe)
        })
    }

    /// Draws a direction from the lobe at roughness `alpha` with the random numbers `u`; returns the event if its ray
    /// hits an emitter. The picture does not count it.
    #[inline]
    pub fn lobe_event(&self, alpha: f32, u: &SharedNumbers) -> Option<Event> {
        self.found_event(&self.find_emission(alpha, u)?)
    }
}

/// An [`EmissionWeight`] with an event to report.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct PendingEmission {
    pub(in crate::integrator) weight: EmissionWeight,
    /// The event to report if the ray hits an emitter, without the emitted radiance.
    pub(in crate::integrator) event: Option<Event>,
}

impl PendingWeight for PendingEmission {
    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.weight.scale(factor);
        if let Some(event) = &mut self.event {
            event.radiance *= factor;
        }
    }

    #[inline]
    fn is_zero(&self) -> bool {
        self.weight.is_zero() && self.event.is_none()
    }
}

impl PendingEmission {
    /// Emission that was counted already.
    pub(in crate::integrator) const COUNTED: Self = Self {
        weight: EmissionWeight {
            throughput: Rgb::ZERO,
            pdf_w: None,
        },
        event: None,
    };

    /// Emission without an event.
    #[inline]
    pub(in crate::integrator) fn of(weight: EmissionWeight) -> Self {
        Self {
            weight,
            event: None,
        }
    }

    /// The contribution of emission; an event is reported.
    #[inline]
    pub(in crate::integrator) fn contribution<O: PathObserver>(
        &self,
        hit: &HitEmission<'_>,
        observer: &mut O,
    ) -> Rgb {
        if O::EVENTS
            && let Some(event) = self.event
        {
            observer.event(&Event {
                radiance: event.radiance * hit.radiance,
                pdf_light: hit.pdf_light(),
                ..event
            });
        }
        self.weight.contribution(hit)
    }
}
