//! The walk of camera paths and light paths, and the steps that estimators share.
//!
//! A [`Walk`] arrives at a surface, has a vertex there, leaves it along a direction that its estimator has drawn, and
//! survives or ends. The walk handles everything between two vertices or along a path (nested bodies, absorption,
//! dispersion, the scaling of refracted radiance, roulette); the loop of an estimator contains only the estimator.
//!
//! | file | step |
//! |---|---|
//! | [`shading_point`] | light sampled from a vertex, emission found by a roughened lobe, the continuation |
//! | [`roughening`] | roughness at next-event estimation, and the path state of a rule |
//! | `pending_emission` | emission at the end of the current ray, and its weight |
//! | `camera` | walks from the camera, and the loop over the pixels of a tile |
//! | `bodies` | nested bodies around the path, and their absorption |
//! | `media` | free flight through media that scatter, and the point where it ends |
//! | `dispersion` | the colour channel of a path after a dispersive interface |
//! | `roulette` | Russian roulette |
//! | `ways` | path splitting at the first smooth interfaces |
//! | `cone` | a Dirac lobe spread over a cone |
//! | `features` | features of a path, which guide filters of pictures |
//! | [`observer`] | callbacks for layers, statistics and training |

mod bodies;
pub(super) mod camera;
pub(super) mod cone;
mod dispersion;
pub(super) mod features;
mod media;
pub(crate) mod observer;
pub(super) mod pending_emission;
pub(crate) mod roughening;
mod roulette;
pub(crate) mod shading_point;
pub(super) mod ways;

use crate::bsdf::{Bsdf, Lobe};
use crate::math::{Frame, Ray, Rgb, Vec3};
use crate::sampler::Sampler;
use crate::scene::sensor::PixelCone;
use crate::scene::{Hit, Scene, Surface};
use bodies::ClosestHit;
/// Media around a point of a path, which absorb light on its way from there.
pub(super) use bodies::EnclosingBodies as Surroundings;
use dispersion::Channel;
pub(super) use pending_emission::{HitEmission, PendingWeight};
use shading_point::{Continuation, ShadingPoint};

/// The end of a path at which a walk began.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    Camera,
    Light,
}

/// A walk on its way to its next vertex, from the camera or from a light.
#[derive(Clone, Copy)]
pub(crate) struct Walk<'a> {
    pub(super) scene: &'a Scene,
    pub(super) origin: Origin,
    /// The ray to the next vertex.
    pub(super) ray: Ray,
    /// Start of the edge: the vertex from which light samples could find the emission at its end. Panes end no edge.
    pub(super) from: Vec3,
    /// Throughput of scattering and absorption so far.
    pub(super) throughput: Rgb,
    /// Factor that cancels, for roulette, scaling that is no loss of light, such as the 1/η² of refraction.
    roulette_scale: f32,
    channel: Channel,
    around: Surroundings,
    /// True on the first edge from the camera.
    from_camera: bool,
    /// The camera's pixel, up to the first vertex, if any texture is filtered over it.
    pixel: PixelCone,
}

/// The surface at which an edge of a walk ends.
#[derive(Clone, Copy)]
pub(super) struct Arrival {
    pub(super) hit: Hit,
    pub(super) surface: Surface,
}

/// A surface point that scatters a walk.
#[derive(Clone, Copy)]
pub(super) struct Interaction<'v> {
    pub(super) surface: &'v Surface,
    pub(super) bsdf: &'v Bsdf,
    /// Shading frame for the direction towards the previous vertex, and that direction in it.
    pub(super) frame: Frame,
    pub(super) wo: Vec3,
    /// The BSDF's own roughness α.
    pub(super) alpha: f32,
}

impl Interaction<'_> {
    /// Media around a ray from here along the world direction `dir`, given those around the previous edge.
    #[inline]
    pub(super) fn around(&self, scene: &Scene, around: &Surroundings, dir: Vec3) -> Surroundings {
        around.towards(scene, self.surface, self.bsdf, self.wo.z > 0.0, dir)
    }

    /// Transmittance from here along a ray, through partial opacity and at most `panes` panes; `None` if something else
    /// blocks it. `around` are the media around the previous edge.
    #[inline]
    pub(super) fn unblocked(
        &self,
        scene: &Scene,
        around: &Surroundings,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        if scene.tracks_bodies() {
            let around = self.around(scene, around, ray.dir);
            around.unblocked(scene, ray, distance, panes)
        } else {
            scene.open_transmittance(ray, panes)
        }
    }

    /// The same towards the camera, through back faces that are hidden from it.
    pub(super) fn unblocked_to_camera(
        &self,
        scene: &Scene,
        around: &Surroundings,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        let direct = self.unblocked(scene, around, ray, distance, panes);
        // A hidden back towards the camera, of a pane or with partial opacity, transmits all light.
        if scene.features().hidden_backs
            && (direct.is_none() || scene.has_panes() || scene.has_layers())
        {
            let around = match scene.tracks_bodies() {
                true => self.around(scene, around, ray.dir),
                false => Surroundings::default(),
            };
            around.unblocked_to_camera(scene, ray, distance, panes)
        } else {
            direct
        }
    }
}

impl<'a> Walk<'a> {
    /// A walk along a camera ray.
    #[inline]
    fn camera(scene: &'a Scene, ray: Ray, around: Surroundings) -> Self {
        Self {
            scene,
            origin: Origin::Camera,
            from: ray.origin,
            ray,
            throughput: Rgb::ONE,
            roulette_scale: 1.0,
            channel: Channel::default(),
            around,
            from_camera: true,
            pixel: PixelCone::default(),
        }
    }

    /// A walk along a ray with this throughput from a light; `infinite` if that is at infinity.
    pub(super) fn light(scene: &'a Scene, ray: Ray, throughput: Rgb, infinite: bool) -> Self {
        let dimmed = match scene.media() {
            Some(media) if infinite => media.outside().transmittance(f32::INFINITY),
            _ => Rgb::ONE,
        };
        Self {
            origin: Origin::Light,
            from_camera: false,
            throughput: throughput * dimmed,
            roulette_scale: 1.0 / throughput.max_element(),
            ..Self::camera(scene, ray, Surroundings::of_light(scene, &ray, infinite))
        }
    }

    /// Media around the origin of the current ray.
    #[inline]
    pub(super) fn around(&self) -> &Surroundings {
        &self.around
    }

    /// The end of the current edge: a surface, or a point of a medium; `None` where the walk has left the scene.
    /// Absorption along the edge scales the throughput. Only media and surfaces of partial opacity use `numbers`.
    #[inline(always)]
    pub(super) fn arrive(
        &mut self,
        pending: &mut impl PendingWeight,
        numbers: &mut impl Sampler,
    ) -> Option<Arrival> {
        if self.scene.draws_ends() {
            return self.arrive_drawn(pending, numbers);
        }
        self.arrive_without_media(pending)
    }

    #[cold]
    #[inline(never)]
    fn arrive_drawn(
        &mut self,
        pending: &mut impl PendingWeight,
        numbers: &mut impl Sampler,
    ) -> Option<Arrival> {
        let mut u = None;
        if self.scene.has_layers() {
            u = numbers.opacity();
        }
        let scene = self.scene;
        let mut closest = |ray: &Ray| scene.intersect_drawn(ray, &mut u);
        match self.scene.media() {
            Some(media) => self.arrive_in(media, pending, numbers, &mut closest),
            None => self.arrive_by(pending, &mut closest),
        }
    }

    /// The same in a scene without [media](Scene::media).
    #[inline(always)]
    pub(super) fn arrive_without_media(
        &mut self,
        pending: &mut impl PendingWeight,
    ) -> Option<Arrival> {
        let scene = self.scene;
        self.arrive_by(pending, &mut |ray: &Ray| scene.intersect(ray))
    }

    /// The same where `closest` finds the closest hit along a ray.
    #[inline(always)]
    fn arrive_by(
        &mut self,
        pending: &mut impl PendingWeight,
        closest: &mut impl ClosestHit,
    ) -> Option<Arrival> {
        let segment = (self.around).follow_seen(self.scene, &self.ray, self.from_camera, closest);
        if let Some(passed) = segment.passed {
            self.throughput *= passed;
            pending.scale(passed);
        }
        if !self.around.is_empty() {
            let end = segment.hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
            let transmittance = self.around.transmittance(self.scene, end - segment.start);
            self.throughput *= transmittance;
            pending.scale(transmittance);
        }
        let hit = segment.hit?;
        let surface = self.surface(&hit, self.ray.dir);
        Some(Arrival { surface, hit })
    }

    /// The surface at a hit of a ray along `dir`. A light walk gets no directions below a facet's plane.
    #[inline(always)]
    fn surface(&self, hit: &Hit, dir: Vec3) -> Surface {
        match self.origin {
            Origin::Camera => self.scene.surface_along(hit, dir),
            Origin::Light => self.scene.surface(hit),
        }
    }

    /// Emission at the end of the current edge; `None` for none.
    #[inline(always)]
    pub(super) fn emission<'b>(&'b self, arrival: Option<&'b Arrival>) -> Option<HitEmission<'b>> {
        let lights = self.scene.lights();
        let surface = arrival.map(|arrival| &arrival.surface);
        let radiance = match surface {
            Some(surface) => lights.emitted(surface, -self.ray.dir),
            None => lights.environment(self.ray.dir),
        };
        (radiance != Rgb::ZERO).then_some(HitEmission {
            radiance,
            lights,
            from: self.from,
            dir: self.ray.dir,
            surface,
        })
    }

    /// The BSDF of the surface at which the walk has arrived; `u`, uniform in [0, 1), chooses between those of its
    /// material. One that is not stored in the scene is written to `made`.
    #[inline(always)]
    pub(super) fn bsdf<'b>(&mut self, surface: &mut Surface, u: f32, made: &'b mut Bsdf) -> &'b Bsdf
    where
        'a: 'b,
    {
        let scene = self.scene;
        if !scene.features().dispersion
            && !scene.features().overlaps
            && let Some(bsdf) = scene.constant_bsdf(surface.material)
        {
            return bsdf;
        }
        let (pixel, dir, from, to) = (self.pixel, self.ray.dir, self.from, surface.position);
        let footprint = || pixel.footprint(dir, from.distance(to));
        *made = (self.channel).bsdf(scene, surface, u, footprint, &mut self.throughput);
        self.around.interface(scene, surface, self.ray.dir, made);
        made
    }

    /// The vertex at the surface at which the walk has arrived.
    #[inline(always)]
    pub(super) fn interaction<'v>(&self, surface: &'v Surface, bsdf: &'v Bsdf) -> Interaction<'v> {
        let back = -self.ray.dir;
        let frame = surface.frame_for(back);
        Interaction {
            surface,
            bsdf,
            frame,
            wo: frame.to_local(back),
            alpha: bsdf.alpha(),
        }
    }

    /// The vertex with the roughness `alpha_reg` at next-event estimation, from which light samples pass at most
    /// `panes` panes.
    #[inline(always)]
    pub(super) fn shading_point<'v>(
        &'v self,
        at: &Interaction<'v>,
        alpha_reg: f32,
        panes: u32,
    ) -> ShadingPoint<'v> {
        ShadingPoint {
            scene: self.scene,
            surface: at.surface,
            frame: at.frame,
            bsdf: at.bsdf,
            wo: at.wo,
            alpha: at.alpha,
            alpha_reg,
            throughput: self.throughput,
            around: &self.around,
            panes,
        }
    }

    /// The same walk with a throughput of 1, for a path of an estimator's own.
    pub(super) fn with_unit_throughput(&self) -> Self {
        Self {
            throughput: Rgb::ONE,
            ..*self
        }
    }

    /// Continues straight through a pane: emission beyond it keeps the MIS weight of the previous vertex.
    pub(super) fn pass(&mut self, surface: &Surface, next: &Continuation) {
        self.throughput *= next.sample.weight;
        self.ray = surface.spawn(next.wi);
        self.from_camera = false;
    }

    /// Leaves a vertex along a continuation.
    #[inline(always)]
    pub(super) fn scatter(&mut self, at: &Interaction<'_>, next: &Continuation) {
        self.throughput *= next.sample.weight;
        self.leave(at, next.sample.lobe, next.wi);
    }

    /// Leaves a vertex along the world direction `wi`, which was drawn from this lobe.
    #[inline(always)]
    pub(super) fn leave(&mut self, at: &Interaction<'_>, lobe: Lobe, wi: Vec3) {
        if lobe == Lobe::Transmission {
            if self.origin == Origin::Camera {
                self.roulette_scale *= at.bsdf.refraction_scale(at.wo);
            }
            if self.scene.tracks_bodies() {
                self.around = at.around(self.scene, &self.around, wi);
            }
        }
        self.ray = at.surface.spawn_leaving(wi);
        self.from = self.ray.origin;
        self.from_camera = false;
        self.pixel = PixelCone::default();
    }

    /// Relates later roulette to the throughput so far: a loss before this vertex does not end the walk.
    #[inline]
    pub(super) fn reset_roulette(&mut self) {
        self.roulette_scale = 1.0 / self.throughput.max_element().max(f32::MIN_POSITIVE);
    }

    /// Russian roulette with survival probability `chance` in (0, 1]; false for a walk that ends. `u` is uniform in
    /// [0, 1), and is rescaled to be so again if the walk survives.
    #[inline]
    pub(super) fn survive_with(
        &mut self,
        chance: f32,
        u: &mut f32,
        pending: &mut impl PendingWeight,
    ) -> bool {
        if *u >= chance {
            return false;
        }
        *u /= chance;
        self.throughput /= chance;
        pending.scale(Rgb::splat(1.0 / chance));
        true
    }

    /// False if the walk ends, because nothing can contribute or by Russian roulette with `u` in [0, 1); `None` for no
    /// roulette.
    #[inline(always)]
    pub(super) fn survive(&mut self, u: Option<f32>, pending: &mut impl PendingWeight) -> bool {
        if self.throughput == Rgb::ZERO && pending.is_zero() {
            return false;
        }
        let Some(u) = u else {
            return true;
        };
        let Some(survival) = roulette::survival(self.throughput, self.roulette_scale, u) else {
            return false;
        };
        self.throughput /= survival;
        pending.scale(Rgb::splat(1.0 / survival));
        true
    }
}
