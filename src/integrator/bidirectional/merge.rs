//! Paths closed by a merge: light vertices within the radius of a camera walk's vertex.

use super::iteration::Iteration;
use super::paths::point;
use super::photons::{MAX_HEIGHT, MIN_COS, PhotonMap, is_within};
use super::split::CameraSummary;
use super::vertex::Vertex;
use super::walk::SharpScatter;
use super::weights;
use crate::image::level_film::{Features, MAX_LEVELS};
use crate::integrator::walk::features::PathFeatures;
use crate::integrator::walk::observer::PathObserver;
use crate::math::measure::balance;
use crate::math::{Frame, Ray, Rgb, UVec2, Vec2, Vec3, warp};
use crate::sampler::{Domain, Independent, IndependentStream, LightU, SampleSource, Sampler, Seed};
use std::f32::consts::PI;

/// Rows and columns of the probes of a disk.
const PROBES: u32 = 2;

/// Most rounds of probes, after which the series is truncated.
const MAX_ROUNDS: u32 = 32;

/// Magnitude of a term of the series below which Russian roulette may end it.
const ROULETTE: f32 = 0.25;

/// Light of a camera path of photon density estimation at several radii.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Densities {
    /// All light, by radius.
    pub(super) levels: [Rgb; MAX_LEVELS],
    /// Light that does not come from photons: the same at all radii.
    pub(super) shared: Rgb,
    /// Features of the path that guide blurs.
    pub(super) features: Features,
}

impl Densities {
    fn add_shared(&mut self, value: Rgb) {
        self.shared += value;
        self.levels.iter_mut().for_each(|light| *light += value);
    }
}

impl Iteration<'_> {
    /// Merges with all photons around a vertex of the camera walk, with MIS weights against all other strategies.
    pub(super) fn merges(
        &self,
        vertex: &Vertex,
        prefix: &CameraSummary<'_>,
        map: &PhotonMap,
        probes: &mut impl Sampler,
    ) -> Rgb {
        let mut sum = Rgb::ZERO;
        map.around(vertex, |photon, arrived, summary| {
            // Both walks count the merged vertex.
            if vertex.n + photon.n() - 1 > self.settings.max_vertices {
                return;
            }
            // The weights count no merges there: light walks arrive at a facet only from above its plane.
            if vertex.surface.is_below(photon.back) {
                return;
            }
            let Some(eval) = vertex.towards_light(photon.back) else {
                return;
            };
            let weight = weights::merge(
                &arrived.partial,
                &vertex.partial,
                eval.pdf_w,
                vertex.pdf_back(photon.back),
                &self.merging,
            );
            let part = match summary {
                Some(summary) => prefix.merged(vertex, photon.first(), photon.back, summary),
                None => Rgb::ONE,
            };
            sum += part * eval.value * arrived.flux * weight;
        });
        self.density(vertex, (sum, self.radius), map.paths(), probes)
    }

    /// Random numbers of the probes of a camera path. A separate stream: their count depends on the photons.
    pub(super) fn probe_stream(&self, pixel: UVec2) -> IndependentStream {
        self.probes.stream(pixel, self.sample)
    }

    /// Random numbers of a camera path's probes at radius number `level`; radius 0 uses the stream of `probe_stream`.
    fn probe_stream_at(&self, level: usize, pixel: UVec2) -> IndependentStream {
        match level {
            0 => self.probe_stream(pixel),
            level => {
                let seed = Seed(self.settings.seed).derive(Domain::Probes, level as u64);
                Independent { seed }.stream(pixel, self.sample)
            }
        }
    }

    /// Traces a camera path of photon density estimation: it follows sharp lobes and merges at rough ones. At sharp
    /// lobes that are not Dirac, lights are sampled too.
    pub(super) fn density_path<O: PathObserver>(
        &self,
        pixel: UVec2,
        map: &PhotonMap,
        observer: &mut O,
    ) -> Rgb {
        self.density_paths(pixel, map, &[self.radius], observer)
            .levels[0]
    }

    /// The same with densities of the same photons at several radii, ascending; the map is built for the largest.
    pub(super) fn density_paths<O: PathObserver>(
        &self,
        pixel: UVec2,
        map: &PhotonMap,
        radii: &[f32],
        observer: &mut O,
    ) -> Densities {
        let settings = &self.settings;
        let mut stream = self.camera_stream(pixel);
        let mut walk = self.camera_walk(pixel, &mut stream);
        let mut probes: [IndependentStream; MAX_LEVELS] =
            std::array::from_fn(|level| self.probe_stream_at(level, pixel));
        let mut total = Densities::default();
        let mut features = PathFeatures::default();
        let lights = self.view.scene.lights();
        // Origin of the current ray, and its density per steradian: 0 for Dirac lobes and camera rays.
        let (mut from, mut pdf_w) = (Vec3::ZERO, 0.0);
        let weight = |pdf_w: f32, of_light: f32| match pdf_w {
            0.0 => 1.0,
            _ => balance(pdf_w, of_light),
        };
        observer.begin(pixel, self.sample);
        for n in 1..=settings.max_vertices + 1 {
            let Some(arrival) = walk.arrive(&mut stream) else {
                let radiance = self.environment(&walk, n);
                if radiance != Rgb::ZERO {
                    let of_light = lights.pdf_environment(from, walk.dir());
                    total.add_shared(radiance * weight(pdf_w, of_light));
                }
                break;
            };
            let u = stream.vertex();
            let vertex = walk.vertex(n, &arrival, u.material);
            let radiance = self.emitter(&walk, &vertex);
            if radiance != Rgb::ZERO {
                let of_light = lights.pdf_emitter(from, &vertex.surface);
                total.add_shared(radiance * weight(pdf_w, of_light));
            }
            if n > settings.max_vertices {
                break;
            }
            if n == 1 {
                observer.vertex(n, arrival.hit.t, &point(&walk, &vertex));
            }
            if radii.len() > 1 {
                features.add(&point(&walk, &vertex), arrival.hit.t);
            }
            if !vertex.is_delta() {
                self.add_photons(&vertex, map, radii, &mut probes, &mut total.levels);
                let light = self.light_at_sharp_lobe(&vertex, u.light);
                total.add_shared(light);
            }
            match walk.follow_sharp(&vertex, u.lobe) {
                Some(SharpScatter::Drawn(pdf)) => (from, pdf_w) = (vertex.surface.position, pdf),
                // Light samples pass panes too: the MIS weight stays that of the previous draw.
                Some(SharpScatter::Straight) => {}
                None => break,
            }
            if n >= settings.roulette_start && walk.survive(u.roulette).is_none() {
                break;
            }
        }
        total.features = features.values();
        observer.way(1.0);
        observer.finish(total.levels[0]);
        total
    }

    /// Adds the photons around a vertex within each of several radii, ascending.
    #[inline(always)]
    fn add_photons(
        &self,
        vertex: &Vertex,
        map: &PhotonMap,
        radii: &[f32],
        probes: &mut [IndependentStream],
        levels: &mut [Rgb],
    ) {
        // By the smallest radius that contains them.
        let mut sums = [Rgb::ZERO; MAX_LEVELS];
        map.around_from(vertex, |photon, arrived, _, to| {
            if vertex.n + photon.n() - 1 <= self.settings.max_vertices
                && let Some(value) = vertex.merged_value(photon.back)
            {
                let ng = vertex.surface.ng;
                let inner = radii.iter().rev().skip(1);
                let within = inner.take_while(|r| is_within(to, ng, **r)).count();
                sums[radii.len() - 1 - within] += value * arrived.flux;
            }
        });
        let mut sum = Rgb::ZERO;
        for (level, &radius) in radii.iter().enumerate() {
            sum += sums[level];
            levels[level] += self.density(vertex, (sum, radius), map.paths(), &mut probes[level]);
        }
    }

    /// A light sampled for the sharp lobe that a walk of photon density estimation follows, with the MIS weight against
    /// that walk. Photons do not merge at this lobe, and no walk hits a light without area.
    fn light_at_sharp_lobe(&self, vertex: &Vertex, u: LightU) -> Rgb {
        if vertex.merges_gloss() {
            return Rgb::ZERO;
        }
        let scene = self.view.scene;
        let Some(light) = scene.lights().sample(vertex.surface.position, u) else {
            return Rgb::ZERO;
        };
        let Some(eval) = vertex.sharp(light.wi) else {
            return Rgb::ZERO;
        };
        let ray = vertex.surface.spawn_to_light(&light);
        let panes = self.left(vertex.n);
        let Some(transmittance) = vertex.unblocked(scene, &ray, light.distance, panes) else {
            return Rgb::ZERO;
        };
        let weight = light.density.mis_weight(eval.pdf_w);
        vertex.throughput
            * eval.value
            * light.radiance
            * transmittance
            * (weight / light.density.value())
    }

    /// Converts a sum over photons within the radius to a contribution. Both walks hit a partly transparent surface
    /// with probability `presence`; the division counts that probability once.
    fn density(
        &self,
        vertex: &Vertex,
        (sum, radius): (Rgb, f32),
        paths: u32,
        probes: &mut impl Sampler,
    ) -> Rgb {
        if sum == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let scene = self.view.scene;
        let material = scene.material(&vertex.surface);
        let presence = material.presence(&scene.parts().textures, vertex.surface.uv);
        let disk = PI * radius * radius;
        let scale =
            self.disk_over_surface(vertex, radius, probes) / (disk * presence * paths as f32);
        vertex.throughput * sum * scale
    }

    /// Unbiased estimate of πr² over the area on which photons merge with a vertex: 1 inside of a plane, more near its
    /// edge.
    ///
    /// With a the area over πr² and q = 1 − a it is 1 + q + q² + …, whose powers are products of independent estimates
    /// of q. The series ends at a term of 0, as inside of a plane, or by roulette.
    fn disk_over_surface(&self, vertex: &Vertex, radius: f32, probes: &mut impl Sampler) -> f32 {
        let scene = self.view.scene;
        if scene.inside_triangle(&vertex.surface, radius) {
            return 1.0;
        }
        let (mut sum, mut term) = (1.0, 1.0f32);
        for _ in 0..MAX_ROUNDS {
            term *= 1.0 - self.surface_over_disk(vertex, radius, probes);
            if term == 0.0 {
                break;
            }
            let survival = term.abs() / ROULETTE;
            if survival < 1.0 {
                if probes.next_1d() >= survival {
                    break;
                }
                term = ROULETTE.copysign(term);
            }
            sum += term;
        }
        sum
    }

    /// Unbiased estimate of the area on which photons merge with a vertex, over πr²: random points of the disk, one in
    /// each of four strata, are projected to the nearest surface on the walk's side.
    fn surface_over_disk(&self, vertex: &Vertex, radius: f32, probes: &mut impl Sampler) -> f32 {
        let scene = self.view.scene;
        let (p, ng) = (vertex.surface.position, vertex.surface.ng);
        let side = vertex.back.dot(ng).signum();
        let frame = Frame::from_normal(ng);
        let height = (MAX_HEIGHT * radius).max(2.0 * vertex.surface.error);
        let mut sum = 0.0;
        for cell in 0..PROBES * PROBES {
            let cell = Vec2::new((cell % PROBES) as f32, (cell / PROBES) as f32);
            let u = (cell + Vec2::new(probes.next_1d(), probes.next_1d())) / PROBES as f32;
            let across = frame.to_world((radius * warp::disk(u)).extend(0.0));
            let mut ray = Ray::new(p + across + side * height * ng, -side * ng);
            ray.t_max = 2.0 * height;
            if let Some((t, cos)) = scene.closest_facing(&ray, ng, MIN_COS) {
                let up = height - t;
                if across.length_squared() + up * up <= radius * radius {
                    sum += 1.0 / cos;
                }
            }
        }
        sum / (PROBES * PROBES) as f32
    }
}
