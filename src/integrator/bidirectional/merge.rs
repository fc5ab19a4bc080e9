//! Paths closed by a merge: light vertices within the radius of a camera walk's vertex.

use super::photons::PhotonMap;
use super::split::Prefix;
use super::vertex::Vertex;
use super::{Iteration, point, weights};
use crate::integrator::walk::observer::PathObserver;
use crate::math::{Rgb, UVec2};
use crate::sampler::Sampler;
use std::f32::consts::PI;

impl Iteration<'_> {
    /// Merges with all photons around a vertex of the camera walk, weighed against all other strategies.
    pub(super) fn merges(&self, vertex: &Vertex, prefix: &Prefix<'_>, map: &PhotonMap) -> Rgb {
        let mut sum = Rgb::ZERO;
        map.around(vertex, |photon, trail| {
            // The path has the merged vertex once.
            if vertex.n + photon.n - 1 > self.settings.max_vertices {
                return;
            }
            let Some(eval) = vertex.towards_light(photon.back) else {
                return;
            };
            let weight = weights::merge(
                &photon.partial,
                &vertex.partial,
                eval.pdf_w,
                vertex.pdf_back(photon.back),
                &self.merging,
            );
            let part = match trail {
                Some(trail) => prefix.merged(vertex, photon.n, photon.back, trail),
                None => Rgb::ONE,
            };
            sum += part * eval.value * photon.flux * weight;
        });
        self.density(vertex, sum)
    }

    /// Walks a camera path of photon density estimation: it goes on along sharp lobes, merges at rough ones, and counts
    /// the lights that it meets in full.
    pub(super) fn density_path<O: PathObserver>(
        &self,
        pixel: UVec2,
        map: &PhotonMap,
        observer: &mut O,
    ) -> Rgb {
        let settings = &self.settings;
        let mut stream = self.camera_stream(pixel);
        let mut walk = self.camera_walk(pixel, &mut stream);
        let mut total = Rgb::ZERO;
        observer.begin(pixel, self.sample);
        for n in 1..=settings.max_vertices + 1 {
            let Some(hit) = walk.arrive() else {
                total += self.environment(&walk, n);
                break;
            };
            let u = stream.vertex();
            let vertex = walk.vertex(n, &hit, u.material);
            total += self.emitter(&vertex);
            if n > settings.max_vertices {
                break;
            }
            if n == 1 {
                observer.vertex(n, hit.0.t, &point(&walk, &vertex));
            }
            if !vertex.is_delta() {
                let mut sum = Rgb::ZERO;
                map.around(&vertex, |photon, _| {
                    if n + photon.n - 1 <= settings.max_vertices
                        && let Some(value) = vertex.merged_value(photon.back)
                    {
                        sum += value * photon.flux;
                    }
                });
                total += self.density(&vertex, sum);
            }
            if walk.follow_sharp(&vertex, u.lobe).is_none()
                || (n >= settings.roulette_start && walk.survive(u.roulette).is_none())
            {
                break;
            }
        }
        observer.finish(total);
        total
    }

    /// A sum over photons within the radius as a contribution. Opacity lets both walks find a vertex by chance, which a
    /// path counts once.
    fn density(&self, vertex: &Vertex, sum: Rgb) -> Rgb {
        if sum == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let scene = self.view.scene;
        let material = scene.material(&vertex.surface);
        let presence = material.presence(&scene.parts().textures, vertex.surface.uv);
        let disk = PI * self.radius * self.radius;
        vertex.throughput * sum / (disk * presence * self.paths as f32)
    }
}
