//! Bodies that light enters and leaves: which of them contain a point, and which one counts where several overlap.
//!
//! Overlapping bodies are nested dielectrics (Schmidt, Budge: *Simple Nested Dielectrics in Ray Traced Images*, Journal
//! of Graphics Tools 7(2), 2002): the one of the highest rank counts, and boundaries of others inside it do not exist.

use super::shells::EdgeStats;
use super::{
    Hit, Material, Mesh, PunctualLight, Scene, SceneParts, SharedMesh, Surface, TriangleId,
};
use crate::math::{Ray, Rgb, Vec3};
use glam::DAffine3;
use rayon::prelude::*;

/// Number of surfaces after which the search for the bodies around a point ends.
pub(crate) const MAX_SURFACES: usize = 10_000;

/// Largest number of triangles of a mesh that are tested for overlaps.
const PROBES: usize = 256;

/// Rank of each material where bodies overlap: a higher priority, then a smaller body (the largest box around one of
/// its meshes), then the later material.
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
        // Instances have many positions in all, and only the ranks of bodies matter.
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
    /// Materials of the bodies around the origin of a ray: those that the ray, followed through all surfaces to
    /// infinity, leaves without having entered, in this order. Bodies count as closed.
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

    /// Material of a body that touches the body of this surface here: a face of each lies in the same plane up to
    /// rounding. Raises the surface's error, so that rays that leave it start clear of both faces.
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
        // Rounding of the corners moves the two faces into different planes.
        let apart = surface.error + 2.0 * f32::EPSILON * largest.into_iter().fold(0.0, f32::max);
        let materials = &self.parts.materials;
        let opposite = |triangle: TriangleId| {
            let material = self.geometry.triangle_material(triangle);
            materials[material as usize].bounds_body()
                && self.geometry.triangle_normal(triangle).dot(surface.ng) < -0.99
                && self.geometry.height(triangle, surface.position).abs() <= apart.into()
        };
        // Longer than the error of distances along rays.
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

    /// For each material of bodies, true if all its meshes are closed with outward normals and no light overlaps the
    /// box around any of them: the body blocks rays from its surface inwards before they reach a light. False for all
    /// materials if opacity makes holes, bodies overlap or a shared mesh emits; false for shared meshes, whose
    /// instances may be many. Runs on one thread, since render threads wait for it: a parallel search could block its
    /// own thread pool for ever.
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
            let defective = || !EdgeStats::of(mesh).all_outwards();
            if dark.get(m) == Some(&true) && (lit(around(mesh)) || defective()) {
                dark[m] = false;
            }
        }
        dark
    }

    /// True if a point just outside some body lies in another body; tested at some triangles of each mesh. Bodies of
    /// the materials `turned` do not count: [`Scene::bodies_around`] is wrong behind their inward normals.
    pub(super) fn find_overlaps(&self, turned: &[u32]) -> bool {
        self.probes().any(|triangle| {
            let surface = self.probe(triangle);
            let around = self.bodies_around(&surface.spawn(surface.ng));
            around.iter().any(|material| !turned.contains(material))
        })
    }

    /// At most [`PROBES`] triangles of each mesh that bounds a body.
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
