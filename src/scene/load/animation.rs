//! Animations: the nodes of a file at a moment `[glTF §3.11]`.

use super::accessors::Data;
use super::error::{Result, Warnings, fault, place};
use glam::{DQuat, DVec4};
use gltf::json::animation::{Interpolation, Property, Sampler};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::Checked;
use gltf::json::{Node, Root};
use std::collections::HashSet;

/// Largest number of keyframes read: channels may share them, so that a small file can request any number.
const MAX_KEYS: usize = 1 << 26;

/// An animation of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Name in the file, or its number.
    pub name: String,
    /// Time of the last keyframe in seconds.
    pub seconds: f64,
    /// True if it moves only cameras: no mesh, skin or light.
    pub of_cameras: bool,
}

/// True if neither the node nor one below it shows or lights anything. `seen` has the visited nodes, to end cycles.
fn is_of_cameras(root: &Root, node: usize, seen: &mut HashSet<usize>) -> bool {
    let Some(found) = root.nodes.get(node).filter(|_| seen.insert(node)) else {
        return true;
    };
    let is_joint = |skin: &gltf::json::Skin| skin.joints.iter().any(|joint| joint.value() == node);
    let shows =
        found.mesh.is_some() || found.extensions.is_some() || root.skins.iter().any(is_joint);
    let mut below = found.children.iter().flatten();
    !shows && below.all(|child| is_of_cameras(root, child.value(), seen))
}

/// The animations of a file, with their lengths from the bounds of accessors.
pub(super) fn list(root: &Root) -> Vec<Animation> {
    let last = |sampler: &Sampler| -> Option<f64> {
        let accessor = root.accessors.get(sampler.input.value())?;
        accessor.max.as_ref()?.get(0)?.as_f64()
    };
    let animation = |(i, a): (usize, &gltf::json::Animation)| Animation {
        name: a.name.clone().unwrap_or_else(|| format!("animation {i}")),
        seconds: a.samplers.iter().filter_map(last).fold(0.0, f64::max),
        of_cameras: (a.channels.iter())
            .all(|c| is_of_cameras(root, c.target.node.value(), &mut HashSet::new())),
    };
    root.animations.iter().enumerate().map(animation).collect()
}

/// The nodes at this many seconds, moved by all animations of the file. Before its first keyframe a property has the
/// value of the first, after its last that of the last. Where two animations move one property, the first counts.
pub(super) fn nodes(data: &Data<'_>, seconds: f64, warnings: &mut Warnings) -> Result<Vec<Node>> {
    let root = data.root;
    let mut nodes = root.nodes.clone();
    let mut moved = HashSet::new();
    let mut left = MAX_KEYS;
    for (a, animation) in root.animations.iter().enumerate() {
        let at = place("animations", a, animation.name.as_ref());
        for (c, channel) in animation.channels.iter().enumerate() {
            let at = format!("{at}.channels[{c}]");
            let (target, sampler) = (channel.target.node.value(), channel.sampler.value());
            let (Some(node), Some(sampler)) =
                (nodes.get_mut(target), animation.samplers.get(sampler))
            else {
                return Err(fault(at, "its node or sampler does not exist"));
            };
            let Checked::Valid(property) = channel.target.path else {
                return Err(fault(at, "unknown path"));
            };
            if !moved.insert((target, property as u8)) {
                let node = place("nodes", target, node.name.as_ref());
                warnings.group(
                    "nodes",
                    node,
                    "several animations move it; the first counts",
                );
                continue;
            }
            if node.matrix.is_some() && property != Property::MorphTargetWeights {
                return Err(fault(at, "moves a node that has a matrix"));
            }
            let keys = Keys::new(data, sampler, seconds, &at, &mut left)?;
            match property {
                Property::Translation => node.translation = Some(keys.vector(&at)?),
                Property::Scale => node.scale = Some(keys.vector(&at)?),
                Property::Rotation => node.rotation = Some(UnitQuaternion(keys.rotation(&at)?)),
                Property::MorphTargetWeights => {
                    let mesh = node.mesh.and_then(|m| root.meshes.get(m.value()));
                    let targets = (mesh.and_then(|m| m.primitives.first()))
                        .and_then(|p| p.targets.as_ref())
                        .map_or(0, Vec::len);
                    node.weights = Some(keys.weights(targets, &at)?);
                }
            }
        }
    }
    Ok(nodes)
}

/// The keyframes around a moment, and their values.
struct Keys<'a> {
    data: &'a Data<'a>,
    output: usize,
    interpolation: Interpolation,
    /// Number of keyframes.
    count: usize,
    /// The keyframe at or before the moment.
    key: usize,
    /// Place of the moment between that keyframe and the next, in [0, 1).
    t: f64,
    /// Seconds between the two.
    length: f64,
}

impl<'a> Keys<'a> {
    fn new(
        data: &'a Data<'a>,
        sampler: &Sampler,
        seconds: f64,
        at: &str,
        left: &mut usize,
    ) -> Result<Self> {
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err(fault(at, "unknown interpolation"));
        };
        let (input, output) = (sampler.input.value(), sampler.output.value());
        let asked = data.count(input).saturating_add(data.count(output));
        let rest = usize::try_from(asked)
            .ok()
            .and_then(|n| left.checked_sub(n));
        *left = rest.ok_or_else(|| fault(at, format!("more than {MAX_KEYS} keyframes")))?;
        let times: Vec<f64> = (data.normalised::<1>(input)?.iter())
            .map(|[t]| f64::from(*t))
            .collect();
        let rising = times.is_sorted_by(|a, b| a < b) && times.iter().all(|t| t.is_finite());
        if times.is_empty() || !rising {
            return Err(fault(at, "its keyframes are none or out of order"));
        }
        let after = times.partition_point(|&t| t <= seconds);
        let (key, t, length) = match after {
            0 => (0, 0.0, 0.0),
            n if n == times.len() => (n - 1, 0.0, 0.0),
            n => {
                let length = times[n] - times[n - 1];
                (n - 1, (seconds - times[n - 1]) / length, length)
            }
        };
        Ok(Self {
            data,
            output,
            interpolation,
            count: times.len(),
            key,
            t,
            length,
        })
    }

    /// The output, whose keyframes have `width` elements each, three times as many with tangents.
    fn values<const N: usize>(&self, width: usize, at: &str) -> Result<Vec<[f32; N]>> {
        let values = self.data.normalised::<N>(self.output)?;
        let each = match self.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Linear | Interpolation::Step => 1,
        };
        let wanted = self.count * width * each;
        if values.len() != wanted {
            let what = format!("{} values, not {wanted}", values.len());
            return Err(fault(at, what));
        }
        Ok(values)
    }

    /// Element `k` of `width`, interpolated; rotations turn along the shorter arc.
    fn element<const N: usize>(
        &self,
        values: &[[f32; N]],
        (k, width): (usize, usize),
        rotation: bool,
    ) -> [f64; N] {
        let at = |index: usize| values[index * width + k].map(f64::from);
        let (key, t) = (self.key, self.t);
        match self.interpolation {
            Interpolation::Step => at(key),
            Interpolation::Linear if t == 0.0 => at(key),
            Interpolation::CubicSpline if t == 0.0 => at(3 * key + 1),
            Interpolation::Linear if rotation => {
                let quat = |v: [f64; N]| DQuat::from_slice(&v).normalize();
                let turned = quat(at(key)).slerp(quat(at(key + 1)), t).to_array();
                std::array::from_fn(|i| turned[i])
            }
            Interpolation::Linear => {
                let (a, b) = (at(key), at(key + 1));
                std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
            }
            // Hermite's basis [glTF App. C]: value and outgoing tangent of this keyframe, value and incoming of the next.
            Interpolation::CubicSpline => {
                let (t2, t3) = (t * t, t * t * t);
                let (v, b) = (at(3 * key + 1), at(3 * key + 2));
                let (a, w) = (at(3 * key + 3), at(3 * key + 4));
                std::array::from_fn(|i| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * v[i]
                        + self.length * (t3 - 2.0 * t2 + t) * b[i]
                        + (3.0 * t2 - 2.0 * t3) * w[i]
                        + self.length * (t3 - t2) * a[i]
                })
            }
        }
    }

    fn vector(&self, at: &str) -> Result<[f32; 3]> {
        let values = self.values::<3>(1, at)?;
        Ok(self.element(&values, (0, 1), false).map(|x| x as f32))
    }

    fn rotation(&self, at: &str) -> Result<[f32; 4]> {
        let values = self.values::<4>(1, at)?;
        let q = DVec4::from(self.element(&values, (0, 1), true));
        let unit = (q.try_normalize()).ok_or_else(|| fault(at, "a rotation without direction"))?;
        Ok(unit.as_vec4().to_array())
    }

    fn weights(&self, targets: usize, at: &str) -> Result<Vec<f32>> {
        let values = self.values::<1>(targets, at)?;
        let weight = |k| self.element(&values, (k, targets), false)[0] as f32;
        Ok((0..targets).map(weight).collect())
    }
}
