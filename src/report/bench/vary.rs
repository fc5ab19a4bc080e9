//! Variants of a scene: how far what was learned on it carries.

use crate::math::Vec3;
use crate::scene::SceneParts;

/// Scales every light with an area about its centre, at the same power: below 1 shadows and caustics get sharper.
pub(super) fn scale_lights(parts: &mut SceneParts, factor: f32) {
    let SceneParts {
        meshes, materials, ..
    } = parts;
    for mesh in meshes.iter_mut() {
        if materials[mesh.material as usize].emission == Vec3::ZERO || mesh.positions.is_empty() {
            continue;
        }
        let centre = mesh.positions.iter().sum::<Vec3>() / mesh.positions.len() as f32;
        for position in &mut mesh.positions {
            *position = centre + (*position - centre) * factor;
        }
    }
    for material in materials {
        material.emission /= factor * factor;
    }
}

/// Scales the roughness of every lobe that is neither perfectly smooth nor diffuse.
pub(super) fn scale_roughness(parts: &mut SceneParts, factor: f32) {
    for material in parts.materials.iter_mut().filter(|m| m.alpha < 1.0) {
        material.alpha = (material.alpha * factor).min(1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gallery::area_light_over_plane;

    #[test]
    fn energy_conservation_of_scaled_lights() {
        let area = |parts: &SceneParts| -> f32 {
            let lit = |m: &&crate::scene::Mesh| {
                parts.materials[m.material as usize].emission != Vec3::ZERO
            };
            let triangles = parts
                .meshes
                .iter()
                .filter(lit)
                .flat_map(|m| m.indices.iter().map(|t| t.map(|i| m.positions[i as usize])));
            triangles
                .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
                .sum()
        };
        let mut parts = area_light_over_plane();
        scale_lights(&mut parts, 0.5);
        assert!((area(&parts) - 1.0).abs() < 1e-6);
        let bright = |p: &SceneParts| p.materials.iter().map(|m| m.emission.x).fold(0.0, f32::max);
        assert_eq!(bright(&parts), 4.0);
    }

    #[test]
    fn roughness_scale_keeps_smooth_and_diffuse() {
        let mut parts = SceneParts::default();
        for alpha in [0.0, 0.2, 0.6, 1.0] {
            parts.add_material(crate::scene::Material {
                alpha,
                ..Default::default()
            });
        }
        scale_roughness(&mut parts, 2.0);
        let alphas: Vec<f32> = parts.materials.iter().map(|m| m.alpha).collect();
        assert_eq!(alphas, [0.0, 0.4, 1.0, 1.0]);
    }
}
