//! Traces light paths and camera paths, which all strategies close.

use super::iteration::Iteration;
use super::photons::PhotonMap;
use super::psr::{Chain, Ends};
use super::split::{CameraSummary, LightSummary};
use super::strategies::{Strategies, Strategy, Total};
use super::vertex::Vertex;
use super::walk::{ScatterKind, WeightedWalk};
use super::weights::Partial;
use crate::image::splat::Splat;
use crate::integrator::walk::observer::PathObserver;
use crate::integrator::walk::shading_point::ShadingPoint;
use crate::integrator::walk::ways::Ways;
use crate::math::{Rgb, UVec2};
use crate::sampler::Sampler;
use crate::scene::sensor::RayDensity;

/// Vertices by which roulette of light walks begins earlier: each is connected to all vertices of a camera walk.
pub(super) const ROULETTE_LEAD: u32 = 3;

/// Share of a camera path's value so far below which a connection is subject to Russian roulette: most shadow rays
/// would gain hardly any light.
const MIN_SHARE: f32 = 0.1;

/// Vertices of a light path for connections to camera paths.
#[derive(Default)]
pub(super) struct LightPath {
    vertices: Vec<Vertex>,
    summaries: Vec<LightSummary>,
    ends: Ends,
}

impl Iteration<'_> {
    /// Rebuilds, from the stored vertices, the light path to which the camera path of a pixel is connected.
    pub(super) fn fetch(&self, pixel: UVec2, map: &PhotonMap, light: &mut LightPath) {
        let columns = u64::from(self.view.sensor.frame.x);
        let number = u64::from(pixel.y) * columns + u64::from(pixel.x);
        let path = (number % u64::from(map.paths())) as u32;
        let most = self.settings.max_vertices - 1;
        let LightPath {
            vertices,
            summaries,
            ..
        } = light;
        map.of_path(path, most, self.view.scene, vertices, summaries);
    }

    /// Traces a light path and stores its vertices in `light`, for one camera path.
    pub(super) fn whole_light_path(
        &self,
        stream: &mut impl Sampler,
        light: &mut LightPath,
        splats: &mut Vec<Splat>,
    ) {
        let LightPath {
            vertices,
            summaries,
            ends,
        } = light;
        vertices.clear();
        summaries.clear();
        ends.clear();
        let keep = |v, summary| {
            vertices.push(v);
            summaries.push(summary);
        };
        self.light_path(stream, keep, ends, splats);
    }

    /// Traces a light path: connects its vertices to the camera, and passes to `keep` those that a camera walk can use.
    pub(super) fn light_path(
        &self,
        stream: &mut impl Sampler,
        mut keep: impl FnMut(Vertex, LightSummary),
        ends: &mut Ends,
        splats: &mut Vec<Splat>,
    ) {
        let strategies = self.strategies;
        let scene = self.view.scene;
        let Some(start) = scene.sample_emission(self.aim, stream.emission()) else {
            return;
        };
        let mut walk = WeightedWalk::light(scene, &start, self.light_merging, self.merge_rule);
        let mut chain = Chain::default();
        let mut summary = LightSummary::START;
        for n in 1..=self.settings.max_vertices {
            let Some(arrival) = walk.arrive(stream) else {
                return;
            };
            if walk.first {
                walk.base.throughput *= walk.window(&start, arrival.hit.t);
            }
            let u = stream.vertex();
            let through = self.view.sensor.lens_point(|| stream.lens());
            let vertex = walk.vertex(n, &arrival, u.material);
            if strategies != Strategies::Density
                && !self.settings.light_sampling_only
                && !vertex.is_delta()
                && strategies.includes(Strategy::Connection { s: n + 1, t: 1 })
                && let Some(splat) = self.connect_to_camera(&vertex, &summary, through)
            {
                splats.push(splat);
            }
            let more = n < self.settings.max_vertices;
            let drawn = if more || self.mollifier.is_some() {
                walk.scatter(&vertex, u.lobe)
            } else {
                None
            };
            self.note_light(
                &start,
                &walk,
                &vertex,
                (drawn, through),
                (&mut chain, ends, splats),
            );
            let merges = self.settings.merging.is_some();
            // The camera walk may draw another BSDF here than the Dirac one of the light walk.
            let merged =
                merges && vertex.merges && (!vertex.is_delta() || vertex.chooses_bsdf(scene));
            let connected = more && strategies.connects() && !vertex.is_delta();
            if merged || connected {
                keep(vertex, summary);
            }
            if let Some(smooth) = drawn.and_then(ScatterKind::smooth) {
                summary = self.summary(summary, &vertex, walk.dir(), smooth);
            }
            let goes_on = more && drawn.is_some();
            if !goes_on
                || (n + ROULETTE_LEAD >= self.settings.roulette_start
                    && walk.survive(u.roulette).is_none())
            {
                return;
            }
        }
    }

    /// A camera walk through a pixel.
    pub(super) fn camera_walk(&self, pixel: UVec2, stream: &mut impl Sampler) -> WeightedWalk<'_> {
        let base = self.camera_walks.start(pixel, stream);
        let RayDensity { pdf, parallel } = self.view.sensor.pdf(base.ray.dir);
        let partial = Partial::camera(pdf, self.paths as f32);
        WeightedWalk {
            base,
            partial,
            merging: self.merging,
            parallel,
            light: None,
            first: true,
            travelled: 0.0,
            length: 0.0,
            start: partial,
            arrived: partial,
            merge_rule: self.merge_rule,
            behind: Some(true),
            pending: 0.0,
        }
    }

    /// Traces a camera path along all its ways; returns the sum of all contributions that end at its vertices.
    pub(super) fn camera_path<O: PathObserver>(
        &self,
        pixel: UVec2,
        light: &LightPath,
        map: Option<&PhotonMap>,
        observer: &mut O,
    ) -> Rgb {
        let (mut ways, mut total) = (Ways::all(), Rgb::ZERO);
        observer.begin(pixel, self.sample);
        loop {
            let stream = &mut self.camera_stream(pixel);
            let value = self.camera_way(pixel, stream, light, map, (&mut ways, observer));
            total += ways.share() * value;
            observer.way(ways.share());
            if !ways.turn() {
                break;
            }
        }
        observer.finish(total);
        total
    }

    /// The same along one way.
    pub(super) fn camera_way<O: PathObserver>(
        &self,
        pixel: UVec2,
        stream: &mut impl Sampler,
        light: &LightPath,
        map: Option<&PhotonMap>,
        (ways, observer): (&mut Ways, &mut O),
    ) -> Rgb {
        let strategies = self.strategies;
        let mut walk = self.camera_walk(pixel, stream);
        let mut chain = Chain::default();
        let mut prefix = self.prefix();
        let mut probes = self.probe_stream(pixel);
        let mut total = Total::new(strategies);
        // True until the first draw from a non-Dirac lobe.
        let mut dirac_only = true;
        for n in 1..=self.settings.max_vertices + 1 {
            let edge = |s| Strategy::Connection { s, t: n + 1 };
            let Some(arrival) = walk.arrive(stream) else {
                let emission = prefix.easy_emission * self.environment(&walk, n);
                total.add(edge(0), emission);
                if dirac_only {
                    observer.dirac_only_light(emission);
                }
                break;
            };
            let mut u = stream.vertex();
            let vertex = walk.vertex(n, &arrival, u.material);
            let emission = prefix.easy_emission * self.emitter(&walk, &vertex);
            total.add(edge(0), emission);
            if dirac_only {
                observer.dirac_only_light(emission);
            }
            if n > self.settings.max_vertices {
                break;
            }
            observer.vertex(n, arrival.hit.t, &point(&walk, &vertex));
            let share = prefix.share(&vertex);
            if strategies.connects() && !vertex.is_delta() {
                total.add(edge(1), self.sampled_light(&vertex, u.light, share));
                self.connections(&vertex, light, &prefix, u.roulette, &mut total);
                if let Some(map) = map
                    && vertex.merges
                {
                    let value = self.merges(&vertex, &prefix, map, &mut probes);
                    total.add(Strategy::Merges, value);
                }
            }
            if strategies == Strategies::All {
                total.add_extra(self.hard_part(&prefix, &vertex, share, &u));
            }
            let mut lobe = u.lobe;
            if dirac_only {
                walk.reset_roulette();
                lobe = ways.choose(&vertex.bsdf, vertex.alpha, vertex.local, lobe);
            }
            let drawn = walk.scatter(&vertex, lobe);
            let is_first = dirac_only && drawn == Some(ScatterKind::Smooth);
            if let Some(smooth) = drawn.and_then(ScatterKind::smooth) {
                dirac_only &= !smooth;
                prefix.scatter(&vertex, walk.dir(), smooth, share);
            }
            let (ends, length) = ((&mut chain, &light.ends), walk.length);
            let value = self.regularised(&walk, &vertex, length, drawn, u.light, ends);
            total.add_extra(value);
            match drawn {
                Some(drawn) if strategies.connects() || drawn != ScatterKind::Smooth => {}
                _ => break,
            }
            if is_first
                && walk
                    .survive_with(ways.survival(), &mut u.roulette)
                    .is_none()
            {
                break;
            }
            if !dirac_only
                && n >= self.settings.roulette_start
                && walk.survive(u.roulette).is_none()
            {
                break;
            }
        }
        total.included
    }

    /// Adds the connections of a vertex of a camera walk to those of a light path.
    #[inline(always)]
    fn connections(
        &self,
        vertex: &Vertex,
        light: &LightPath,
        prefix: &CameraSummary<'_>,
        u: f32,
        total: &mut Total,
    ) {
        let least = MIN_SHARE * total.all.max_element();
        for (other, summary) in light.vertices.iter().zip(&light.summaries) {
            if vertex.n + other.n > self.settings.max_vertices {
                break;
            }
            // Stored for merges only.
            if other.is_delta() {
                continue;
            }
            let part = prefix.connected(vertex, other, summary);
            if part != Rgb::ZERO {
                let u = (u + 0.618_034 * other.n as f32).fract();
                let value = part * self.connection(vertex, other, (least, u));
                let (s, t) = (other.n + 1, vertex.n + 1);
                total.add(Strategy::Connection { s, t }, value);
            }
        }
    }
}

/// A vertex of a camera walk in the form that observers take.
pub(super) fn point<'a>(walk: &WeightedWalk<'a>, vertex: &'a Vertex) -> ShadingPoint<'a> {
    ShadingPoint {
        scene: walk.base.scene,
        surface: &vertex.surface,
        frame: vertex.frame,
        bsdf: &vertex.bsdf,
        wo: vertex.local,
        alpha: vertex.alpha,
        alpha_reg: vertex.alpha,
        throughput: vertex.throughput,
        around: &vertex.around,
        panes: 0,
    }
}
