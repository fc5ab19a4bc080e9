//! The node graph: the nodes of the scene with their poses.

use super::error::{Result, fault, place};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::{Node, Root};

/// A node of the scene with its pose in the world.
pub(super) struct PlacedNode<'a> {
    pub(super) node: &'a Node,
    /// Its index in the file.
    pub(super) index: usize,
    pub(super) pose: DAffine3,
    /// Place in the file, for messages.
    pub(super) place: String,
}

/// All nodes of the file's scene, parents before children, in file order; `nodes` are those of the file at some moment.
pub(super) fn placed<'a>(root: &Root, nodes: &'a [Node]) -> Result<Vec<PlacedNode<'a>>> {
    let mut seen = vec![false; nodes.len()];
    let mut stack: Vec<(usize, DAffine3)> = roots(root)?
        .into_iter()
        .rev()
        .map(|i| (i, DAffine3::IDENTITY))
        .collect();
    let mut out = Vec::new();
    while let Some((i, parent)) = stack.pop() {
        let Some(node) = nodes.get(i) else {
            return Err(fault(format!("nodes[{i}]"), "does not exist"));
        };
        let place = place("nodes", i, node.name.as_ref());
        if std::mem::replace(&mut seen[i], true) {
            let what = "is reached twice: a node may have one parent only, and no cycles";
            return Err(fault(place, what));
        }
        let pose = parent * local(node, &place)?;
        if !pose.is_finite() || !pose.translation.as_vec3().is_finite() {
            return Err(fault(place, "its transform is not finite"));
        }
        let children = node.children.iter().flatten().rev();
        stack.extend(children.map(|child| (child.value(), pose)));
        out.push(PlacedNode {
            node,
            index: i,
            pose,
            place,
        });
    }
    Ok(out)
}

/// The roots of the default scene, else of the first scene; in a file without scenes, every node without a parent.
fn roots(root: &Root) -> Result<Vec<usize>> {
    let number = root.scene.map_or(0, |s| s.value());
    if let Some(scene) = root.scenes.get(number) {
        return Ok(scene.nodes.iter().map(|n| n.value()).collect());
    }
    if root.scene.is_some() {
        return Err(fault("scene", format!("scenes[{number}] does not exist")));
    }
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|n| n.children.iter().flatten()) {
        if let Some(flag) = is_child.get_mut(child.value()) {
            *flag = true;
        }
    }
    let all = 0..root.nodes.len();
    let roots: Vec<usize> = all.filter(|&i| !is_child[i]).collect();
    if roots.is_empty() && !root.nodes.is_empty() {
        return Err(fault(
            "nodes",
            "every node is a child of another: the graph has a cycle",
        ));
    }
    Ok(roots)
}

fn local(node: &Node, place: &str) -> Result<DAffine3> {
    if let Some(matrix) = node.matrix {
        let m = DMat4::from_cols_array(&matrix.map(f64::from));
        let below = m.row(3);
        if (below.truncate().abs().max_element() > 1e-6) || (below.w - 1.0).abs() > 1e-6 {
            return Err(fault(place, "the last row of its matrix is not 0 0 0 1"));
        }
        return Ok(DAffine3::from_mat4(m));
    }
    let vector = |v: Option<[f32; 3]>, or: DVec3| v.map_or(or, |v| DVec3::from(v.map(f64::from)));
    let rotation = match node.rotation {
        None => DQuat::IDENTITY,
        Some(q) => {
            let q = DQuat::from_array(q.0.map(f64::from));
            let length = q.length();
            // Rounding makes the length differ from 1 a little; a large difference is an error.
            if !(0.5..2.0).contains(&length) {
                return Err(fault(place, "its rotation is not a unit quaternion"));
            }
            if length == 1.0 { q } else { q.normalize() }
        }
    };
    Ok(DAffine3::from_scale_rotation_translation(
        vector(node.scale, DVec3::ONE),
        rotation,
        vector(node.translation, DVec3::ZERO),
    ))
}
