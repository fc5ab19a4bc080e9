//! Closed meshes that transmit without a thickness: glass as modelling programs export it, most of it meant as bodies.

use super::error::{Warnings, place};
use crate::scene::shells::Shell;
use crate::scene::{Material, Mesh};

/// Meaning of closed meshes that transmit without a thickness.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Glass {
    /// Bodies, as the user says.
    Solid,
    /// Thin walls, as the user says.
    Thin,
    /// Bodies, since the file is Blender's.
    OfBlender,
    /// Thin walls, as glTF says.
    Unknown,
}

/// Makes bodies of the closed meshes among those whose material transmits and says nothing of its thickness, or leaves them thin
/// walls; warns of what the user did not say. `thickness_known` holds one entry per material of the file, the default material last.
///
/// A material that open meshes have too stays theirs; the closed ones get a solid copy. Such bodies have the square root of the
/// base colour for the tint of an interface: a wall tints light once, a body where it enters and where it leaves.
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
            .partition(|mesh| Shell::of(mesh).is_closed());
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
