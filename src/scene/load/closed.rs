//! Closed meshes that transmit without a thickness: glass as modelling programs export it, most of it meant as bodies.

use super::error::{Warnings, place};
use crate::scene::shells::EdgeStats;
use crate::scene::{Material, Mesh};

/// Meaning of closed meshes that transmit without a thickness.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Glass {
    /// Bodies, by the user's choice.
    Solid,
    /// Thin walls, by the user's choice.
    Thin,
    /// Bodies, since the file is Blender's.
    OfBlender,
    /// Thin walls, by the definition of glTF.
    Unknown,
}

/// Makes solid bodies of closed meshes whose material transmits without a thickness, or thin walls; warns if this is
/// not the user's choice. `thickness_known` has one entry per material of the file, the default material last.
///
/// If open meshes have the material too, the closed ones get a solid copy. The tint of each interface is the square
/// root of the base colour: a wall tints light once, a body where light enters and where it leaves.
pub(super) fn bodies(
    meshes: &mut [&mut Mesh],
    materials: &mut Vec<Material>,
    thickness_known: &[bool],
    glass: Glass,
    warnings: &mut Warnings,
) {
    let number = materials.len();
    for i in 0..number {
        if materials[i].transmission == 0.0 || thickness_known[i] {
            continue;
        }
        let (closed, open): (Vec<&mut Mesh>, Vec<&mut Mesh>) = (meshes.iter_mut())
            .map(|mesh| &mut **mesh)
            .filter(|mesh| mesh.material as usize == i)
            .partition(|mesh| EdgeStats::of(mesh).is_closed());
        if closed.is_empty() {
            continue;
        }
        let at = place("materials", i, Some(&materials[i].name));
        match glass {
            Glass::Solid => {}
            Glass::Thin => continue,
            Glass::OfBlender => {
                let what = "transmit without a thickness (KHR_materials_volume) on closed meshes, shown as solid bodies, since the \
                            file comes from Blender; --glass thin makes thin walls of them";
                warnings.group("materials", at, what);
            }
            Glass::Unknown => {
                let what = "transmit without a thickness (KHR_materials_volume) on closed meshes, shown as thin walls, which do \
                            not refract; --glass solid makes bodies of them";
                warnings.group("materials", at, what);
                continue;
            }
        }
        if open.is_empty() {
            (materials[i].solid, materials[i].root_tint) = (true, true);
        } else {
            let copy = Material {
                solid: true,
                root_tint: true,
                ..materials[i].clone()
            };
            (closed.into_iter()).for_each(|mesh| mesh.material = materials.len() as u32);
            materials.push(copy);
        }
    }
}
