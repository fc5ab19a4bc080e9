//! Bodies that light enters and leaves: which of them hold a point, which one is there where several overlap.
//!
//! Overlapping bodies are nested dielectrics (Schmidt, Budge: *Simple Nested Dielectrics in Ray Traced Images*, Journal of
//! Graphics Tools 7(2), 2002): the one of the highest rank is there, and the others' boundaries inside of it do not exist.

use super::{Hit, Scene, SceneParts};
use crate::math::{Ray, Vec3};
use rayon::prelude::*;

/// Surfaces at which the search for the bodies around a point gives up.
pub const MOST_SURFACES: usize = 10_000;

/// Triangles of a mesh at which overlaps are looked for.
const PROBES: usize = 256;

/// Rank of each material where bodies overlap: a higher priority, then a smaller body (the largest box around one of its
/// meshes), then the later material.
pub(super) fn ranks(parts: &SceneParts) -> Vec<u32> {
    let mut extents = vec![0.0f32; parts.materials.len()];
    for mesh in &parts.meshes {
        let (low, high) = mesh
            .positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| {
                (low.min(p), high.max(p))
            });
        if let Some(extent) = extents.get_mut(mesh.material as usize) {
            *extent = extent.max(low.distance(high));
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
        let mut triangles = vec![Vec::new(); self.parts.meshes.len()];
        for i in 0..self.geometry.len() as u32 {
            if bounds[self.geometry.triangle_material(i) as usize] {
                triangles[self.geometry.triangle_mesh(i) as usize].push(i);
            }
        }
        let probes: Vec<u32> = (triangles.iter())
            .flat_map(|of_mesh| {
                of_mesh
                    .iter()
                    .step_by(of_mesh.len().div_ceil(PROBES).max(1))
            })
            .copied()
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
