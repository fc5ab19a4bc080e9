//! Closed meshes that transmit without a thickness: glass as modelling programs export it, most of it meant as bodies.

use super::error::{Warnings, place};
use crate::scene::bodies::is_closed;
use crate::scene::{Material, Mesh};

/// Warns of the closed meshes among those whose material transmits and says nothing of its thickness, or, with `solid`,
/// makes bodies of them. `thickness_known` holds one entry per material of the file, the default material last.
///
/// A material that open meshes have too stays theirs; the closed ones get a solid copy.
pub(super) fn bodies(
    meshes: &mut [&mut Mesh],
    materials: &mut Vec<Material>,
    thickness_known: &[bool],
    solid: bool,
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
            .partition(|mesh| is_closed(mesh));
        if closed.is_empty() {
            continue;
        }
        if !solid {
            let name = Some(&materials[i].name);
            warnings.say(format!(
                "{}: transmits without a thickness (KHR_materials_volume) on closed meshes: shown as thin walls, which do \
                 not refract; --solid-glass makes bodies of them",
                place("materials", i, name)
            ));
        } else if open.is_empty() {
            materials[i].solid = true;
        } else {
            let copy = Material {
                solid: true,
                ..materials[i].clone()
            };
            (closed.into_iter()).for_each(|mesh| mesh.material = materials.len() as u32);
            materials.push(copy);
        }
    }
}
