//! Strategies that close a path by an edge. Each computes the value, then the weight, then the shadow ray: most values
//! are zero, and the ray costs most.

use super::iteration::Iteration;
use super::split::LightSummary;
use super::vertex::Vertex;
use super::walk::WeightedWalk;
use super::weights::{self, End};
use crate::image::splat::Splat;
use crate::math::{Rgb, Vec2};
use crate::sampler::LightU;
use crate::scene::Surface;

/// Density per area, at a vertex, of a direction with density `pdf_w` per steradian.
#[inline]
fn per_area(pdf_w: f32, cos: f32, distance2: f32) -> f32 {
    pdf_w * cos / distance2
}

impl Vertex {
    /// This vertex as an end of a closing edge; `allows` if the other end allows merges here.
    #[inline]
    fn end(&self, pdf_area: f32, pdf_reverse: f32, allows: bool) -> End<f32> {
        End {
            partial: self.partial,
            pdf_area,
            pdf_reverse,
            merges: self.merges && allows,
        }
    }
}

impl Iteration<'_> {
    /// Vertices still allowed after this many: the most panes on the closing edge.
    #[inline]
    pub(super) fn left(&self, vertices: u32) -> u32 {
        self.settings.max_vertices.saturating_sub(vertices)
    }

    /// s = 0: emission of the surface at this vertex of the camera walk.
    #[inline]
    pub(super) fn emitter(&self, walk: &WeightedWalk<'_>, vertex: &Vertex) -> Rgb {
        let lights = self.view.scene.lights();
        let radiance = lights.emitted(&vertex.surface, vertex.back);
        if radiance == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let weight = self.strategies.weight(0, vertex.n + 1, || {
            if vertex.first {
                return 1.0;
            }
            let pdf = lights.pdf_emission(self.aim, &vertex.surface, vertex.back);
            let sampled = lights.pdf_a_emitter(walk.base.from, &vertex.surface);
            weights::hit(&walk.arrived, sampled, pdf.position * pdf.direction)
        });
        vertex.throughput * radiance * weight
    }

    /// s = 0: environment light, where the camera walk left the scene before its vertex `n`.
    #[inline]
    pub(super) fn environment(&self, walk: &WeightedWalk<'_>, n: u32) -> Rgb {
        let scene = self.view.scene;
        let radiance = scene.lights().environment(walk.dir());
        if radiance == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let weight = self.strategies.weight(0, n + 1, || {
            if walk.first {
                return 1.0;
            }
            let lights = scene.lights();
            let pdf = lights.pdf_emission_environment(self.aim, &walk.base.ray);
            let sampled = lights.pdf_environment(walk.base.from, walk.dir());
            weights::hit(&walk.partial, sampled, pdf.position * pdf.direction)
        });
        walk.base.throughput * radiance * weight
    }

    /// s = 1: a light sampled from a vertex of the camera walk, without the share `h` of its glossy lobe.
    #[inline]
    pub(super) fn sampled_light(&self, vertex: &Vertex, u: LightU, h: f32) -> Rgb {
        let scene = self.view.scene;
        let Some(light) = scene.lights().sample(vertex.surface.position, u) else {
            return Rgb::ZERO;
        };
        let Some(eval) = vertex.towards_light(light.wi) else {
            return Rgb::ZERO;
        };
        let weight = self.strategies.weight(1, vertex.n + 1, || {
            let cos = vertex.cos(light.wi);
            let infinite = light.distance == f32::INFINITY;
            let distance2 = if infinite {
                1.0
            } else {
                light.distance * light.distance
            };
            let pdf_hit = if light.density.is_delta() {
                0.0
            } else {
                eval.pdf_w / light.density.value()
            };
            let from = vertex.surface.position;
            let emitted = (scene.lights()).emission_over_sampling(self.aim, &light, from);
            let pdf_area = per_area(emitted, cos, distance2);
            let end = vertex.end(pdf_area, vertex.pdf_back(light.wi), false);
            weights::light_sample(pdf_hit, &end, &self.merging)
        });
        let part = vertex.easy_part(light.wi, h);
        if weight == 0.0 || part == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let ray = vertex.surface.spawn_to_light(&light);
        let Some(transmittance) =
            vertex.unblocked(scene, &ray, light.distance, self.left(vertex.n))
        else {
            return Rgb::ZERO;
        };
        part * vertex.throughput
            * eval.value
            * light.radiance
            * transmittance
            * (weight / light.density.value())
    }

    /// s, t > 1: a vertex of the camera walk connected to a vertex of the light walk. Connections with an unshadowed
    /// value below `least` are subject to Russian roulette before the shadow ray; `u` is uniform in [0, 1).
    #[inline]
    pub(super) fn connection(
        &self,
        vertex: &Vertex,
        light: &Vertex,
        (least, u): (f32, f32),
    ) -> Rgb {
        let scene = self.view.scene;
        let to = light.surface.position - vertex.surface.position;
        let distance2 = to.length_squared();
        let distance = distance2.sqrt();
        let dir = to / distance;
        // Points of one triangle or of one plane are not connected: rounding would connect the two sides.
        let error = vertex.surface.error + light.surface.error;
        let in_plane =
            |surface: &Surface| !surface.is_in_medium() && to.dot(surface.ng).abs() <= error;
        let same = light.hit.triangle == vertex.hit.triangle && !vertex.surface.is_in_medium();
        if !dir.is_finite() || same || in_plane(&vertex.surface) || in_plane(&light.surface) {
            return Rgb::ZERO;
        }
        // Early exit: most pairs face away from each other.
        if !(vertex.scatters_to(dir) || vertex.surface.is_below(dir)) || !light.scatters_to(-dir) {
            return Rgb::ZERO;
        }
        let Some(here) = vertex.towards_light(dir) else {
            return Rgb::ZERO;
        };
        let Some(there) = light.towards_camera(-dir) else {
            return Rgb::ZERO;
        };
        let (cos_here, cos_there) = (vertex.cos(dir), light.cos(-dir));
        let allows = |end: &Vertex| self.merge_rule.allows(end.is_sharp(), distance);
        let weight = self.strategies.weight(light.n + 1, vertex.n + 1, || {
            weights::connection(
                &light.end(
                    per_area(here.pdf_w, cos_there, distance2),
                    there.pdf_w,
                    allows(vertex),
                ),
                &vertex.end(
                    per_area(light.pdf_on(-dir), cos_here, distance2),
                    vertex.pdf_back(dir),
                    allows(light),
                ),
                &self.merging,
            )
        });
        if weight == 0.0 {
            return Rgb::ZERO;
        }
        let mut value = vertex.throughput
            * here.value
            * there.value
            * light.throughput
            * (weight * cos_there / distance2);
        let chance = value.max_element() / least;
        if chance < 1.0 {
            if u >= chance {
                return Rgb::ZERO;
            }
            value /= chance;
        }
        let ray = (vertex.surface).spawn_to(&light.surface, dir, distance, cos_there);
        let panes = self.left(vertex.n + light.n);
        let Some(transmittance) = vertex.unblocked(scene, &ray, distance, panes) else {
            return Rgb::ZERO;
        };
        value * transmittance
    }

    /// t = 1: a vertex of the light walk connected to the camera, through a point of its lens if there is one. Camera
    /// walks draw lens points from the same density, so it cancels.
    #[inline]
    pub(super) fn connect_to_camera(
        &self,
        vertex: &Vertex,
        summary: &LightSummary,
        through: Vec2,
    ) -> Option<Splat> {
        let scene = self.view.scene;
        let sight = (self.view.sensor).see(vertex.surface.position, through)?;
        let splat = Splat::new(&self.view.window, sight.pixel, Rgb::ZERO)?;
        let seen = vertex.seen_by_camera(scene, &sight);
        let vertex = seen.as_ref().unwrap_or(vertex);
        let hidden = scene.hides_surface(&vertex.surface, -sight.wo);
        if hidden || !vertex.scatters_to(sight.wo) {
            return None;
        }
        let eval = vertex.towards_camera(sight.wo)?;
        let paths = self.paths as f32;
        let pdf_area = sight.pdf_area(vertex.cos(sight.wo));
        let weight = self.strategies.weight(vertex.n + 1, 1, || {
            weights::camera_sample(
                &vertex.end(pdf_area, eval.pdf_w, true),
                paths,
                &self.merging,
            )
        });
        let mut ray = vertex.surface.spawn(sight.wo);
        ray.t_max = sight.distance;
        let part = self.seen_part(vertex, summary, sight.wo);
        if weight == 0.0 || part == Rgb::ZERO {
            return None;
        }
        let panes = self.left(vertex.n);
        let transmittance = vertex.unblocked_to_camera(scene, &ray, sight.distance, panes)?;
        let value =
            part * vertex.throughput * eval.value * transmittance * (weight * pdf_area / paths);
        Some(Splat { value, ..splat })
    }
}
