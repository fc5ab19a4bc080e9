//! Path space regularisation of paths that no strategy can sample `[PSR §4.5]`.
//!
//! Lights that no camera walk can hit are found by a connection of two non-Dirac vertices; camera and light count as
//! such. A path without such an edge has, at both ends, an edge with one Dirac end. Its Dirac lobe is spread over a
//! cone of ε = atan(r/l) about the ideal direction, with l the length of the edge. Every edge with one Dirac end could
//! be spread, but the integrands differ, so that no MIS weights combine them: the longest such edge of the path is
//! spread, which has the smallest cone and the least bias. Edges with two Dirac ends are never spread.

use super::iteration::Iteration;
use super::vertex::Vertex;
use super::walk::{ScatterKind, WeightedWalk};
use crate::image::splat::Splat;
use crate::integrator::walk::Surroundings;
use crate::integrator::walk::cone::Cone;
use crate::math::{Rgb, Vec2, Vec3};
use crate::sampler::LightU;
use crate::scene::{EmissionSample, Surface};

/// Properties of a walk's edges that decide where it is regularised.
#[derive(Clone, Copy, Default)]
pub(super) struct Chain {
    /// True if some edge joins two non-Dirac vertices.
    samplable: bool,
    /// Length of the longest edge with one Dirac end.
    longest: f32,
    /// True if the last vertex is Dirac.
    delta: bool,
}

impl Chain {
    /// The chain with one more edge, and a vertex that is Dirac if `delta`.
    fn with(self, delta: bool, length: f32) -> Self {
        Self {
            samplable: self.samplable || !(self.delta || delta),
            longest: if self.delta == delta {
                self.longest
            } else {
                self.longest.max(length)
            },
            delta,
        }
    }

    /// True if an edge of this length that joins two walks is the one at which their path is regularised.
    fn closes(&self, other: &Self, length: f32) -> bool {
        !self.samplable
            && !other.samplable
            && self.delta != other.delta
            && length > self.longest.max(other.longest)
    }

    /// The light or the camera itself.
    const END: Self = Self {
        samplable: false,
        longest: 0.0,
        delta: false,
    };
}

/// A vertex at which a walk follows a Dirac lobe.
struct DiracEnd {
    n: u32,
    surface: Surface,
    /// Ideal direction, and the walk's throughput along it.
    dir: Vec3,
    throughput: Rgb,
    /// Media around that direction.
    around: Surroundings,
}

/// Ends of a light walk for edges with one Dirac end.
#[derive(Default)]
pub(super) struct Ends {
    smooth: Vec<(Vertex, Chain)>,
    dirac: Vec<(DiracEnd, Chain)>,
}

impl DiracEnd {
    fn new(vertex: &Vertex, walk: &WeightedWalk<'_>) -> Self {
        Self {
            n: vertex.n,
            surface: vertex.surface,
            dir: walk.dir(),
            throughput: walk.base.throughput,
            around: *walk.base.around(),
        }
    }

    /// Throughput along another direction, per steradian.
    #[inline]
    fn spread(&self, radius: f32, dir: Vec3, distance: f32) -> Option<Rgb> {
        let same_side = dir.dot(self.surface.ng) * self.dir.dot(self.surface.ng) > 0.0;
        let density = Cone::new(radius, distance).density(self.dir, dir);
        (same_side && density > 0.0).then(|| self.throughput * density)
    }
}

impl Ends {
    pub(super) fn clear(&mut self) {
        self.smooth.clear();
        self.dirac.clear();
    }
}

impl Iteration<'_> {
    /// Distance assumed for a light at infinity.
    fn far(&self) -> f32 {
        let (low, high) = self.view.scene.geometry().bounds();
        low.distance(high)
    }

    /// Stores a vertex of a light walk as an end of regularised edges, before roulette; `drawn` is the draw there.
    /// Connects a Dirac vertex to the camera if that edge is the path's longest.
    pub(super) fn note_light(
        &self,
        start: &EmissionSample,
        walk: &WeightedWalk<'_>,
        vertex: &Vertex,
        (drawn, through): (Option<ScatterKind>, Vec2),
        (chain, ends, splats): (&mut Chain, &mut Ends, &mut Vec<Splat>),
    ) {
        let Some(radius) = self
            .mollifier
            .filter(|_| start.cos == 0.0 && !chain.samplable)
        else {
            return;
        };
        let edge = if vertex.first && start.pdf.infinite {
            self.far()
        } else {
            walk.length
        };
        if !vertex.is_delta() {
            ends.smooth.push((*vertex, chain.with(false, edge)));
        }
        let Some(smooth) = drawn.and_then(ScatterKind::smooth) else {
            return;
        };
        *chain = chain.with(!smooth, edge);
        if smooth {
            return;
        }
        let end = DiracEnd::new(vertex, walk);
        splats.extend(self.dirac_to_camera(&end, chain, radius, through));
        ends.dirac.push((end, *chain));
    }

    fn dirac_to_camera(
        &self,
        end: &DiracEnd,
        chain: &Chain,
        radius: f32,
        through: Vec2,
    ) -> Option<Splat> {
        let scene = self.view.scene;
        let sight = (self.view.sensor).see(end.surface.position, through)?;
        let splat = Splat::new(&self.view.window, sight.pixel, Rgb::ZERO)?;
        let hidden = scene.hides_surface(&end.surface, -sight.wo);
        if hidden || !Chain::END.closes(chain, sight.distance) {
            return None;
        }
        let throughput = end.spread(radius, sight.wo, sight.distance)?;
        let mut ray = end.surface.spawn(sight.wo);
        ray.t_max = sight.distance;
        let panes = self.left(end.n);
        let transmittance = (end.around).unblocked_to_camera(scene, &ray, sight.distance, panes)?;
        // The cosine of the surface is in the throughput.
        let value = throughput * transmittance * (sight.pdf_area(1.0) / self.paths as f32);
        Some(Splat { value, ..splat })
    }

    /// Closes paths by regularised edges at a vertex of the camera walk, before roulette; `drawn` is the draw there.
    pub(super) fn regularised(
        &self,
        walk: &WeightedWalk<'_>,
        vertex: &Vertex,
        distance: f32,
        drawn: Option<ScatterKind>,
        u: LightU,
        (chain, light): (&mut Chain, &Ends),
    ) -> Rgb {
        let Some(radius) = self.mollifier.filter(|_| !chain.samplable) else {
            return Rgb::ZERO;
        };
        let mut total = Rgb::ZERO;
        if !vertex.is_delta() {
            let here = chain.with(false, distance);
            for (end, there) in &light.dirac {
                total +=
                    self.smooth_to_dirac(vertex, end, radius, |length| here.closes(there, length));
            }
        }
        let Some(smooth) = drawn.and_then(ScatterKind::smooth) else {
            return total;
        };
        *chain = chain.with(!smooth, distance);
        if smooth {
            return total;
        }
        let end = DiracEnd::new(vertex, walk);
        total += self.dirac_to_light(&end, chain, radius, u);
        for (other, there) in &light.smooth {
            total +=
                self.dirac_to_smooth(&end, other, radius, |length| chain.closes(there, length));
        }
        total
    }

    fn dirac_to_light(&self, end: &DiracEnd, chain: &Chain, radius: f32, u: LightU) -> Rgb {
        let scene = self.view.scene;
        let sampled = scene.lights().sample(end.surface.position, u);
        let Some(light) = sampled.filter(|light| light.density.is_delta()) else {
            return Rgb::ZERO;
        };
        let length = light.distance.min(self.far());
        if !chain.closes(&Chain::END, length) {
            return Rgb::ZERO;
        }
        let Some(throughput) = end.spread(radius, light.wi, length) else {
            return Rgb::ZERO;
        };
        let ray = end.surface.spawn_to_light(&light);
        let panes = self.left(end.n);
        let Some(transmittance) = end.around.unblocked(scene, &ray, light.distance, panes) else {
            return Rgb::ZERO;
        };
        throughput * light.radiance * transmittance / light.density.value()
    }

    /// A Dirac vertex of the camera walk and a non-Dirac vertex of the light walk.
    fn dirac_to_smooth(
        &self,
        end: &DiracEnd,
        light: &Vertex,
        radius: f32,
        closes: impl FnOnce(f32) -> bool,
    ) -> Rgb {
        let scene = self.view.scene;
        let to = light.surface.position - end.surface.position;
        let distance = to.length();
        let dir = to / distance;
        if end.n + light.n > self.settings.max_vertices || !dir.is_finite() || !closes(distance) {
            return Rgb::ZERO;
        }
        let Some(throughput) = end.spread(radius, dir, distance) else {
            return Rgb::ZERO;
        };
        let Some(there) = light.towards_camera(-dir) else {
            return Rgb::ZERO;
        };
        let cos = light.cos(-dir);
        let segment = end.surface.spawn_to(&light.surface, dir, distance, cos);
        let panes = self.left(end.n + light.n);
        let Some(transmittance) = end.around.unblocked(scene, &segment, distance, panes) else {
            return Rgb::ZERO;
        };
        throughput * transmittance * there.value * light.throughput * (cos / (distance * distance))
    }

    /// A non-Dirac vertex of the camera walk and a Dirac vertex of the light walk.
    fn smooth_to_dirac(
        &self,
        vertex: &Vertex,
        end: &DiracEnd,
        radius: f32,
        closes: impl FnOnce(f32) -> bool,
    ) -> Rgb {
        let scene = self.view.scene;
        let to = end.surface.position - vertex.surface.position;
        let distance = to.length();
        let dir = to / distance;
        if vertex.n + end.n > self.settings.max_vertices || !dir.is_finite() || !closes(distance) {
            return Rgb::ZERO;
        }
        let Some(throughput) = end.spread(radius, -dir, distance) else {
            return Rgb::ZERO;
        };
        let Some(here) = vertex.towards_light(dir) else {
            return Rgb::ZERO;
        };
        let cos = super::weights::clamped(end.surface.ng.dot(dir));
        let segment = vertex.surface.spawn_to(&end.surface, dir, distance, cos);
        let panes = self.left(vertex.n + end.n);
        let Some(transmittance) = vertex.unblocked(scene, &segment, distance, panes) else {
            return Rgb::ZERO;
        };
        vertex.throughput * here.value * transmittance * throughput / (distance * distance)
    }
}
