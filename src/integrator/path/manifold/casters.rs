//! The smooth interfaces by way of which light is sought.

use super::constraint::Patch;
use crate::bsdf::{Bsdf, DELTA_ALPHA, is_matched};
use crate::math::discrete::AliasTable;
use crate::math::{Vec2, warp};
use crate::scene::material::AlphaMode;
use crate::scene::{Hit, Material, Scene, Surface};

/// Triangles of smooth metals and smooth glass whose BSDF is the same everywhere.
pub(super) struct Casters {
    /// For each material, the index inside over that outside; 0 for a metal, `None` for what is no caster.
    etas: Vec<Option<f32>>,
    triangles: Vec<u32>,
    /// Choice of a triangle: all meshes alike, the triangles of one by area.
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
                Bsdf::Glossy(_) | Bsdf::Exact(_) => Some(0.0),
                _ => None,
            }
        };
        let materials = scene.parts().materials.iter().enumerate();
        let etas: Vec<Option<f32>> = materials.map(eta).collect();
        let geometry = scene.geometry();
        let (mut triangles, mut weights) = (Vec::new(), Vec::new());
        for range in geometry.ranges() {
            let of = |i: &u32| etas[geometry.triangle_material(*i) as usize].is_some();
            let start = weights.len();
            for i in range.filter(of) {
                triangles.push(i);
                weights.push(f64::from(geometry.triangle_area(i)));
            }
            let area: f64 = weights[start..].iter().sum();
            weights[start..].iter_mut().for_each(|w| *w /= area);
        }
        let choice = AliasTable::new(&weights);
        (!choice.is_empty()).then_some(Self {
            etas,
            triangles,
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
        let (k, _) = self.choice.sample(pick)?;
        let weights = warp::triangle(u);
        Some(Hit {
            t: 0.0,
            triangle: self.triangles[k],
            u: weights.x,
            v: weights.y,
        })
    }
}

/// The triangle of a surface point.
pub(super) fn patch(scene: &Scene, triangle: u32) -> Patch {
    let (corners, normals) = scene.geometry().smooth_triangle(triangle);
    Patch {
        corners: corners.map(|p| p.as_dvec3()),
        normals: normals.map(|n| n.as_dvec3()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gallery::{materials, shapes};
    use crate::math::Vec3;
    use crate::sampler::{Independent, SampleSource, Sampler, Seed};
    use crate::scene::SceneParts;

    /// Two mirrors, one much larger than the other, beside one of chalk: cells of each get the same number of seeds.
    #[test]
    fn manifold_seeds_chi_square() {
        let mut parts = SceneParts::default();
        let quad = |x: f32, side: f32| shapes::quad(Vec3::X * x, side * Vec3::X, side * Vec3::Y);
        let both = [quad(0.0, 1.0), quad(10.0, 5.0)];
        parts.add(materials::metal("silver", Vec3::ONE, 0.0), both);
        let chalk = materials::diffuse("chalk", Vec3::ONE);
        parts.add(chalk, [quad(20.0, 1.0)]);
        let scene = Scene::new(parts);
        let casters = Casters::of(&scene).expect("casters");
        const CELLS: usize = 4;
        const SEEDS: u32 = 32_000;
        let mut counts = [0u32; 2 * CELLS * CELLS];
        let mut stream = Independent { seed: Seed(1) }.stream(crate::math::UVec2::ZERO, 0);
        for _ in 0..SEEDS {
            let pick = stream.next_pick();
            let u = Vec2::new(stream.next_1d(), stream.next_1d());
            let at = scene
                .surface(&casters.point(pick, u).expect("a seed"))
                .position;
            let (k, at) = match at.x {
                x if x < 5.0 => (0, at),
                x => (1, Vec3::new(x - 10.0, at.y, 0.0) / 5.0),
            };
            let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
            counts[(k * CELLS + cell(at.x)) * CELLS + cell(at.y)] += 1;
        }
        let expected = f64::from(SEEDS) / counts.len() as f64;
        let square = |count: &u32| (f64::from(*count) - expected).powi(2) / expected;
        let chi2: f64 = counts.iter().map(square).sum();
        // 31 degrees of freedom, probability 1e-3.
        assert!(chi2 < 61.1, "{chi2}");
    }
}
