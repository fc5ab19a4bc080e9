//! The smooth interfaces over which manifold sampling connects to lights.

use super::constraint::Patch;
use crate::bsdf::{Bsdf, DELTA_ALPHA, is_matched};
use crate::math::discrete::AliasTable;
use crate::math::{Vec2, warp};
use crate::scene::material::AlphaMode;
use crate::scene::{Hit, Material, Scene, Surface, TriangleId};

/// Triangles of smooth metals and smooth glass whose BSDF is the same everywhere.
pub(super) struct Casters {
    /// For each material, the index inside over that outside; 0 for a metal, `None` for a material that is no caster.
    etas: Vec<Option<f32>>,
    /// Triangles that no instances share.
    triangles: Vec<TriangleId>,
    /// First triangle of each instance, and the index of its mesh in `shared`.
    instances: Vec<(TriangleId, u32)>,
    /// Choice of a triangle of each shared mesh, by its area in the first instance.
    shared: Vec<AliasTable>,
    /// Choice of an unshared triangle or an instance: meshes and instances alike, the triangles of a mesh by area.
    choice: AliasTable,
}

impl Casters {
    /// Casters of a scene; `None` where there are none.
    pub(super) fn of(scene: &Scene) -> Option<Self> {
        let eta = |(i, material): (usize, &Material)| {
            let bsdf = scene.constant_bsdf(i as u32)?;
            let alpha = bsdf.alpha();
            let whole =
                material.normal_texture.is_none() && material.alpha_mode == AlphaMode::Opaque;
            if !whole || alpha >= DELTA_ALPHA || !bsdf.is_delta_at(alpha) {
                return None;
            }
            match bsdf {
                Bsdf::Dielectric(glass) if !is_matched(glass.eta) => Some(glass.eta),
                Bsdf::Glossy(_) | Bsdf::FresnelGlossy(_) => Some(0.0),
                _ => None,
            }
        };
        let materials = scene.parts().materials.iter().enumerate();
        let etas: Vec<Option<f32>> = materials.map(eta).collect();
        let geometry = scene.geometry();
        let (mut triangles, mut weights) = (Vec::new(), Vec::new());
        let (mut instances, mut shared) = (Vec::<(TriangleId, u32)>::new(), Vec::new());
        let mut runs = geometry.runs();
        runs.retain(|run| etas[geometry.triangle_material(run.first()) as usize].is_some());
        for run in runs {
            let first = run.first();
            let is_instance = first.instance() > 0;
            // Instances of one mesh follow one another.
            let known = (instances.last()).is_some_and(|(last, _)| last.index() == first.index());
            if !is_instance || !known {
                let all: Vec<_> = run.every(0, 1).collect();
                let areas: Vec<f64> = (all.iter())
                    .map(|&i| geometry.triangle_area(i).into())
                    .collect();
                if is_instance {
                    shared.push(AliasTable::new(&areas));
                } else {
                    let area: f64 = areas.iter().sum();
                    weights.extend(areas.iter().map(|a| a / area));
                    triangles.extend(all);
                }
            }
            if is_instance {
                instances.push((first, shared.len() as u32 - 1));
            }
        }
        weights.resize(triangles.len() + instances.len(), 1.0);
        let choice = AliasTable::new(&weights);
        (!choice.is_empty()).then_some(Self {
            etas,
            triangles,
            instances,
            shared,
            choice,
        })
    }

    /// Index inside over that outside of a caster, 0 for a metal; `None` for another surface.
    #[inline]
    pub(super) fn eta(&self, surface: &Surface) -> Option<f32> {
        self.etas[surface.material as usize]
    }

    /// A random point on the casters.
    pub(super) fn point(&self, pick: f64, u: Vec2) -> Option<Hit> {
        let (k, rest) = self.choice.sample(pick)?;
        let triangle = match self.triangles.get(k) {
            Some(&triangle) => triangle,
            None => {
                let (first, mesh) = self.instances[k - self.triangles.len()];
                let (k, _) = self.shared[mesh as usize].sample(rest)?;
                first.after(k as u32)
            }
        };
        let weights = warp::triangle(u);
        Some(Hit {
            t: 0.0,
            triangle,
            u: weights.x,
            v: weights.y,
        })
    }
}

/// Corners and normals of a triangle.
pub(super) fn patch(scene: &Scene, triangle: TriangleId) -> Patch {
    let (corners, normals) = scene.geometry().smooth_triangle(triangle);
    Patch {
        corners: corners.map(|p| p.as_dvec3()),
        normals: normals.map(|n| n.as_dvec3()),
    }
}

#[cfg(test)]
mod tests;
