//! Bodies that light enters and leaves: which of them hold a point, which one is there where several overlap.
//!
//! Overlapping bodies are nested dielectrics (Schmidt, Budge: *Simple Nested Dielectrics in Ray Traced Images*, Journal of
//! Graphics Tools 7(2), 2002): the one of the highest rank is there, and the others' boundaries inside of it do not exist.

use super::{Hit, Material, Scene, SceneParts, SharedMesh};
use crate::math::{Ray, Vec3};
use glam::DAffine3;
use rayon::prelude::*;

/// Surfaces at which the search for the bodies around a point gives up.
pub const MOST_SURFACES: usize = 10_000;

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
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = points.fold(start, |(low, high), p| (low.min(p), high.max(p)));
    low.distance(high)
}

impl Scene {
    /// Materials of the bodies around the origin of a ray: those that the ray, followed through all surfaces to infinity,
    /// leaves without having entered, in this order. Bodies are taken for closed.
    pub fn bodies_around(&self, ray: &Ray) -> Vec<u32> {
        let mut ray = *ray;
        let (mut entered, mut around) = (Vec::new(), Vec::new());
        for _ in 0..MOST_SURFACES {
            let Some(hit) = self.intersect(&ray) else {
                break;
            };
            let surface = self.surface(&hit);
            if self.material(&surface).bounds_body() {
                if ray.dir.dot(surface.ng) < 0.0 {
                    entered.push(surface.material);
                } else if let Some(i) = entered.iter().rposition(|&m| m == surface.material) {
                    entered.remove(i);
                } else {
                    around.push(surface.material);
                }
            }
            ray = surface.spawn(ray.dir);
        }
        around
    }

    /// True if the outside of some body, just before its surface, lies in another body; looked for at some triangles of
    /// each mesh.
    pub(super) fn find_overlaps(&self) -> bool {
        let bounds: Vec<bool> = (self.parts.materials.iter())
            .map(|m| m.bounds_body())
            .collect();
        if !bounds.contains(&true) {
            return false;
        }
        let probes: Vec<u32> = (self.geometry.ranges().into_iter())
            .filter(|of_mesh| bounds[self.geometry.triangle_material(of_mesh.start) as usize])
            .flat_map(|of_mesh| {
                let step = of_mesh.len().div_ceil(PROBES);
                of_mesh.step_by(step)
            })
            .collect();
        probes.into_par_iter().any(|triangle| {
            let surface = self.surface(&Hit {
                t: 0.0,
                triangle,
                u: 0.3,
                v: 0.35,
            });
            !self.bodies_around(&surface.spawn(surface.ng)).is_empty()
        })
    }
}
