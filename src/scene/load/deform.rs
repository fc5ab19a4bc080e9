//! Deformation of meshes: morph targets and skins `[glTF §3.7.2.2, §3.7.3]`.

use super::accessors::Data;
use super::error::{Result, Warnings, fault, place};
use super::nodes::PlacedNode;
use glam::{DAffine3, DMat3, DMat4, DVec3};
use std::collections::HashMap;

/// For each skin, the matrices of its joints from mesh to world; `None` if it is unused or cannot be applied.
pub(super) struct Skins(Vec<Option<Vec<DAffine3>>>);

impl Skins {
    pub(super) fn new(
        data: &Data<'_>,
        nodes: &[PlacedNode<'_>],
        warnings: &mut Warnings,
    ) -> Result<Self> {
        let mut skins = vec![None; data.root.skins.len()];
        let mut used: Vec<usize> = (nodes.iter())
            .filter_map(|n| n.node.skin.map(|s| s.value()))
            .collect();
        used.sort_unstable();
        used.dedup();
        if used.is_empty() {
            return Ok(Self(skins));
        }
        let poses: HashMap<usize, DAffine3> = nodes.iter().map(|n| (n.index, n.pose)).collect();
        for index in used {
            let Some(skin) = data.root.skins.get(index) else {
                return Err(fault(format!("skins[{index}]"), "does not exist"));
            };
            let at = place("skins", index, skin.name.as_ref());
            let inverse = (skin.inverse_bind_matrices)
                .map(|accessor| data.matrices(accessor.value()))
                .transpose()?;
            if inverse
                .as_ref()
                .is_some_and(|m| m.len() < skin.joints.len())
            {
                return Err(fault(at, "fewer inverse bind matrices than joints"));
            }
            let matrix = |(i, joint): (usize, usize)| {
                let bind = inverse.as_ref().map_or(DAffine3::IDENTITY, |m| {
                    DAffine3::from_mat4(DMat4::from_cols_array(&m[i].map(f64::from)))
                });
                Some(*poses.get(&joint)? * bind)
            };
            let joints = skin.joints.iter().map(|j| j.value()).enumerate();
            skins[index] = joints.map(matrix).collect();
            if skins[index].is_none() {
                warnings.say(format!(
                    "{at}: a joint is not in the scene; its meshes are shown in their rest pose"
                ));
            }
        }
        Ok(Self(skins))
    }

    /// The joints of a skin; `None` for one that cannot be applied.
    pub(super) fn joints(&self, index: usize) -> Option<&[DAffine3]> {
        self.0.get(index)?.as_deref()
    }
}

/// Joints and weights of the vertices of a primitive, in sets of four.
pub(super) type Influences = (Vec<[u32; 4]>, Vec<[f32; 4]>);

/// The matrix of each of `count` vertices: the weighted mean of the matrices of its joints.
pub(super) fn blended(
    joints: &[DAffine3],
    sets: &[Influences],
    count: usize,
    at: &str,
) -> Result<Vec<DAffine3>> {
    let of = |vertex: usize| {
        let pairs = (sets.iter())
            .flat_map(|(numbers, weights)| numbers[vertex].into_iter().zip(weights[vertex]))
            .filter(|&(_, weight)| weight != 0.0);
        let (mut m, mut t, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        for (number, weight) in pairs {
            let Some(joint) = joints.get(number as usize) else {
                let what = format!(
                    "joint {number} of vertex {vertex} is not below {}",
                    joints.len()
                );
                return Err(fault(at, what));
            };
            let weight = f64::from(weight);
            m += joint.matrix3 * weight;
            t += joint.translation * weight;
            sum += weight;
        }
        // Weights should add up to 1; integers do so within rounding.
        match sum > 0.0 && sum.is_finite() {
            true => Ok(DAffine3::from_mat3_translation(m * (1.0 / sum), t / sum)),
            false => Err(fault(at, format!("vertex {vertex} has no weight"))),
        }
    };
    (0..count).map(of).collect()
}
