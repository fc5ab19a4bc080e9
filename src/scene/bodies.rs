//! Bodies that light enters and leaves: which of them hold a point, which one is there where several overlap.
//!
//! Overlapping bodies are nested dielectrics (Schmidt, Budge: *Simple Nested Dielectrics in Ray Traced Images*, Journal of
//! Graphics Tools 7(2), 2002): the one of the highest rank is there, and the others' boundaries inside of it do not exist.

use super::shells::Shell;
use super::{
    Hit, Material, Mesh, PunctualLight, Scene, SceneParts, SharedMesh, Surface, TriangleId,
};
use crate::math::{Ray, Rgb, Vec3};
use glam::DAffine3;
use rayon::prelude::*;

/// Surfaces at which the search for the bodies around a point gives up.
pub(crate) const MAX_SURFACES: usize = 10_000;

/// Triangles of a mesh at which overlaps are looked for.
const PROBES: usize = 256;

/// Rank of each material where bodies overlap: a higher priority, then a smaller body (the largest box around one of its
/// meshes), then the later material.
pub(super) fn ranks(parts: &SceneParts) -> Vec<u32> {
    let mut extents = vec![0.0f32; parts.materials.len()];
    let mut extend = |material: u32, extent: f32| {
        if let Some(most) = extents.get_mut(material as usize) {
            *most = most.max(extent);
        }
    };
    for mesh in &parts.meshes {
        extend(mesh.material, extent(mesh.positions.iter().copied()));
    }
    for SharedMesh { mesh, poses } in &parts.shared {
        // Positions times instances are many, and the rank of what is no body does not matter.
        let body = parts.materials.get(mesh.material as usize);
        if body.is_some_and(Material::bounds_body) {
            let of = |pose: &DAffine3| {
                let there = |p: &Vec3| pose.transform_point3(p.as_dvec3()).as_vec3();
                extent(mesh.positions.iter().map(there))
            };
            let largest = poses.par_iter().map(of).reduce(|| 0.0, f32::max);
            extend(mesh.material, largest);
        }
    }
    let mut order: Vec<usize> = (0..extents.len()).collect();
    order.sort_by(|&a, &b| {
        let priority = |i: usize| parts.materials[i].priority;
        (priority(a).total_cmp(&priority(b))).then(extents[b].total_cmp(&extents[a]))
    });
    let mut ranks = vec![0; order.len()];
    for (rank, i) in order.into_iter().enumerate() {
        ranks[i] = rank as u32;
    }
    ranks
}

/// Diagonal of the box around points.
fn extent(points: impl Iterator<Item = Vec3>) -> f32 {
    let (low, high) = bounds(points);
    low.distance(high)
}

/// The box around points.
fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    points.fold(start, |(low, high), p| (low.min(p), high.max(p)))
}

impl Scene {
    /// Materials of the bodies around the origin of a ray: those that the ray, followed through all surfaces to infinity,
    /// leaves without having entered, in this order. Bodies are taken for closed.
    pub fn bodies_around(&self, ray: &Ray) -> Vec<u32> {
        let mut ray = *ray;
        let (mut entered, mut around) = (Vec::new(), Vec::new());
        let mut pass = |material: u32, enters: bool| {
            if enters {
                entered.push(material);
            } else if let Some(i) = entered.iter().rposition(|&m| m == material) {
                entered.remove(i);
            } else {
                around.push(material);
            }
        };
        for _ in 0..MAX_SURFACES {
            let Some(hit) = self.intersect(&ray) else {
                break;
            };
            let mut surface = self.surface(&hit);
            if self.material(&surface).bounds_body() {
                let enters = ray.dir.dot(surface.ng) < 0.0;
                pass(surface.material, enters);
                if let Some(other) = self.touching(&mut surface) {
                    pass(other, !enters);
                }
            }
            ray = surface.spawn(ray.dir);
        }
        around
    }

    /// Material of a body that touches the body of this surface here: it begins where the other ends, since a face of each lies
    /// in the same plane up to rounding. A ray that leaves the surface then keeps clear of both.
    #[inline]
    pub(crate) fn touching(&self, surface: &mut Surface) -> Option<u32> {
        if self.features.touching {
            self.find_touching(surface)
        } else {
            None
        }
    }

    #[cold]
    fn find_touching(&self, surface: &mut Surface) -> Option<u32> {
        let corners = self.geometry.triangle(surface.triangle);
        let largest = corners.map(|p| p.abs().max_element());
        // Four corners that were rounded lie in two planes.
        let apart = surface.error + 2.0 * f32::EPSILON * largest.into_iter().fold(0.0, f32::max);
        let materials = &self.parts.materials;
        let opposite = |triangle: TriangleId| {
            let material = self.geometry.triangle_material(triangle);
            materials[material as usize].bounds_body()
                && self.geometry.triangle_normal(triangle).dot(surface.ng) < -0.99
                && self.geometry.height(triangle, surface.position).abs() <= apart.into()
        };
        // Long enough for the error of distances along rays.
        let reach = 8.0 * apart;
        let mut ray = Ray::new(surface.position + reach * surface.ng, -surface.ng);
        ray.t_max = 2.0 * reach;
        let hit = self.geometry.closest_of(&ray, opposite)?;
        surface.error = surface.error.max(2.0 * apart);
        Some(self.geometry.triangle_material(hit.triangle))
    }

    /// True if bodies touch at one of the probes.
    pub(super) fn finds_touching(&self) -> bool {
        (self.probes()).any(|triangle| self.find_touching(&mut self.probe(triangle)).is_some())
    }

    /// For each material, true if all its meshes are closed, facing outwards, and no light reaches into the box around any of them: a ray
    /// that starts on such a surface towards its inside is blocked by the body before it meets a light. False for all where
    /// opacity makes holes, or where boundaries of overlapping bodies do not exist; for shared meshes, whose instances may be
    /// many; and for all where such a mesh shines. One thread, since paths wait for it: a
    /// pool of threads that waits for itself would never end.
    pub(super) fn find_dark_insides(&self) -> Vec<bool> {
        let SceneParts {
            meshes,
            shared,
            materials,
            lights,
            ..
        } = &self.parts;
        let mut dark: Vec<bool> = materials.iter().map(Material::bounds_body).collect();
        let material = |mesh: &Mesh| mesh.material as usize;
        let shines =
            |mesh: &Mesh| (materials.get(material(mesh))).is_some_and(|m| m.emission != Rgb::ZERO);
        let unknown = self.features.overlaps || self.geometry.has_opacity();
        if unknown || shared.iter().any(|shared| shines(&shared.mesh)) || !dark.contains(&true) {
            return vec![false; dark.len()];
        }
        for SharedMesh { mesh, .. } in shared {
            if let Some(dark) = dark.get_mut(material(mesh)) {
                *dark = false;
            }
        }
        let around = |mesh: &Mesh| bounds(mesh.positions.iter().copied());
        let area = meshes.iter().filter(|mesh| shines(mesh)).map(around);
        let points = lights.iter().filter_map(|light| match light {
            PunctualLight::Point { position, .. } | PunctualLight::Spot { position, .. } => {
                Some((*position, *position))
            }
            PunctualLight::Directional { .. } => None,
        });
        let lights: Vec<(Vec3, Vec3)> = area.chain(points).collect();
        let lit = |(low, high): (Vec3, Vec3)| {
            // Clear of rounding errors.
            let slack = 1e-3 * (high - low).max_element() * Vec3::ONE;
            let (low, high) = (low - slack, high + slack);
            (lights.iter()).any(|(l, h)| l.cmple(high).all() && h.cmpge(low).all())
        };
        for mesh in meshes {
            let m = material(mesh);
            if dark.get(m) == Some(&true) && (lit(around(mesh)) || !Shell::of(mesh).all_outwards())
            {
                dark[m] = false;
            }
        }
        dark
    }

    /// True if the outside of some body, just before its surface, lies in another body; looked for at some triangles of
    /// each mesh. Bodies of the materials `turned` do not count: behind a triangle whose normal points inwards everything
    /// looks as if it lay in them.
    pub(super) fn find_overlaps(&self, turned: &[u32]) -> bool {
        self.probes().any(|triangle| {
            let surface = self.probe(triangle);
            let around = self.bodies_around(&surface.spawn(surface.ng));
            around.iter().any(|material| !turned.contains(material))
        })
    }

    /// Some triangles of each mesh that bounds a body.
    fn probes(&self) -> impl ParallelIterator<Item = TriangleId> {
        let bounds: Vec<bool> = (self.parts.materials.iter())
            .map(|m| m.bounds_body())
            .collect();
        let runs = match bounds.contains(&true) {
            true => self.geometry.runs(),
            false => Vec::new(),
        };
        (runs.into_par_iter())
            .filter(move |run| bounds[self.geometry.triangle_material(run.first()) as usize])
            .flat_map_iter(|run| {
                let step = run.len().div_ceil(PROBES);
                run.every(0, step)
            })
    }

    /// A point of a triangle.
    fn probe(&self, triangle: TriangleId) -> Surface {
        self.surface(&Hit {
            t: 0.0,
            triangle,
            u: 0.3,
            v: 0.35,
        })
    }
}

#[cfg(test)]
mod tests;
