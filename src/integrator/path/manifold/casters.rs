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
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::sampler::{Independent, SampleSource, Sampler, Seed};
    use crate::scene::procedural::{materials, shapes};
    use crate::scene::{SceneParts, SharedMesh};
    use glam::{DAffine3, DVec3};

    /// Two mirrors and two instances of a third, small and large ones, beside a diffuse quad: all cells of the mirrors
    /// get equally many seeds.
    #[test]
    fn manifold_seeds_chi_square() {
        let mut parts = SceneParts::default();
        let quad = |x: f32, side: f32| shapes::quad(Vec3::X * x, side * Vec3::X, side * Vec3::Y);
        let both = [quad(0.0, 1.0), quad(10.0, 5.0)];
        parts.add(materials::metal("silver", Vec3::ONE, 0.0), both);
        let chalk = materials::diffuse("chalk", Vec3::ONE);
        parts.add(chalk, [quad(20.0, 1.0)]);
        // A mesh of four triangles that differ in area.
        let mut mesh = quad(0.0, 1.0);
        mesh.positions.push(Vec3::new(0.25, 0.25, 0.0));
        mesh.indices = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        let poses = [(30.0, 1.0), (40.0, 5.0)].map(|(x, scale)| {
            let scale = DAffine3::from_scale(DVec3::splat(scale));
            DAffine3::from_translation(DVec3::X * x) * scale
        });
        parts.shared.push(SharedMesh {
            mesh,
            poses: poses.into(),
        });
        let scene = Scene::new(parts);
        let casters = Casters::of(&scene).expect("casters");
        const CELLS: usize = 4;
        const SEEDS: u32 = 64_000;
        let mut counts = [0u32; 4 * CELLS * CELLS];
        let mut stream = Independent { seed: Seed(1) }.stream(crate::math::UVec2::ZERO, 0);
        for _ in 0..SEEDS {
            let pick = stream.next_pick();
            let u = Vec2::new(stream.next_1d(), stream.next_1d());
            let at = scene
                .surface(&casters.point(pick, u).expect("a seed"))
                .position;
            let mirrors = [(0.0, 1.0), (10.0, 5.0), (30.0, 1.0), (40.0, 5.0)];
            let k = mirrors.partition_point(|&(x, _)| x <= at.x) - 1;
            let (x, side) = mirrors[k];
            let at = (at - x * Vec3::X) / side;
            let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
            counts[(k * CELLS + cell(at.x)) * CELLS + cell(at.y)] += 1;
        }
        let expected = f64::from(SEEDS) / counts.len() as f64;
        let square = |count: &u32| (f64::from(*count) - expected).powi(2) / expected;
        let chi2: f64 = counts.iter().map(square).sum();
        // 63 degrees of freedom, probability 1e-3.
        assert!(chi2 < 103.4, "{chi2}");
    }
}
