//! Closed meshes that transmit without a thickness: glass as modelling programs export it, most of it meant as bodies.

use super::error::{Warnings, place};
use crate::math::{DVec3, Vec3};
use crate::scene::{Material, Mesh};
use std::collections::HashMap;

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

/// True for a mesh that bounds a volume from outside: every edge is met once in each direction for every two triangles,
/// and the normals point outwards. Vertices at the same place count as one, since exporters split them at seams.
fn is_closed(mesh: &Mesh) -> bool {
    // Zero has two signs.
    let bits = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut numbers = HashMap::new();
    let welded: Vec<u32> = (mesh.positions.iter())
        .map(|&p| {
            let next = numbers.len() as u32;
            *numbers.entry(bits(p)).or_insert(next)
        })
        .collect();
    let mut balance: HashMap<(u32, u32), i32> = HashMap::new();
    let mut volume = 0.0;
    let Some(origin) = mesh.positions.first() else {
        return false;
    };
    for face in &mesh.indices {
        let [a, b, c] = face.map(|v| (mesh.positions[v as usize] - origin).as_dvec3());
        volume += DVec3::dot(a, b.cross(c));
        let [a, b, c] = face.map(|v| welded[v as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            match from.cmp(&to) {
                std::cmp::Ordering::Less => *balance.entry((from, to)).or_default() += 1,
                std::cmp::Ordering::Greater => *balance.entry((to, from)).or_default() -= 1,
                // A triangle without area, as at the poles of a sphere.
                std::cmp::Ordering::Equal => {}
            }
        }
    }
    volume > 0.0 && balance.values().all(|&b| b == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gallery::shapes;

    #[test]
    fn closed_meshes_are_found_across_seams_and_open_ones_are_not() {
        let ball = shapes::sphere(Vec3::ONE, 0.5, 8);
        // A mesh without shared vertices, as exporters write hard edges.
        let apart = Mesh {
            positions: (ball.indices.iter().flatten())
                .map(|&v| ball.positions[v as usize])
                .collect(),
            indices: (0..ball.indices.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect(),
            ..Mesh::default()
        };
        let mut inside_out = ball.clone();
        inside_out.indices.iter_mut().for_each(|f| f.reverse());
        let mut holed = ball.clone();
        holed.indices.pop();
        let pane = shapes::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        assert!(is_closed(&ball) && is_closed(&apart));
        assert!(is_closed(&shapes::cuboid(Vec3::ZERO, Vec3::ONE)));
        for open in [inside_out, holed, pane, Mesh::default()] {
            assert!(!is_closed(&open));
        }
    }
}
