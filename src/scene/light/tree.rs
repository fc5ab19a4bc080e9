//! Light tree: a light is drawn by a bound of its irradiance at a point, from its distance, position and orientation
//! `[ContyKulla18]`, `[PBRT4 §12.6.3]`.

use crate::math::Vec3;
use crate::math::discrete::ALMOST_ONE;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Bounds of some lights: positions, directions, intensity.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBounds {
    /// Corners of the box.
    pub low: Vec3,
    pub high: Vec3,
    /// Cone of the directions in which the lights face, and the cosine of its half angle.
    pub axis: Vec3,
    pub cos_facing: f32,
    /// Cosine of the largest angle between the facing of a light and its emission.
    pub cos_emission: f32,
    /// True if a light emits to both sides.
    pub two_sided: bool,
    /// Sum of the radiant intensities (luminance) in the directions in which the lights face.
    pub intensity: f32,
}

/// A light of the tree, or with members all lights of a mesh.
pub(super) struct Item {
    pub bounds: LightBounds,
    /// Index of the light.
    pub light: u32,
    pub members: Vec<Item>,
}

/// Tree over lights at finite distance.
pub(super) struct LightTree {
    nodes: Vec<WideNode>,
    /// Node and slot of each light, by index of the light; [`NONE`] for lights that are not in the tree.
    leaves: Vec<Slot>,
}

/// Place of a child in a node.
#[derive(Clone, Copy, Debug)]
struct Slot {
    node: u32,
    child: u32,
}

/// Children of a node. One choice among eight replaces three levels of a binary tree, and is evaluated in vector
/// registers.
const WIDTH: usize = 8;

/// Bounds of the children of a node as one array per component, and the children.
struct WideNode {
    x: Lanes,
    y: Lanes,
    z: Lanes,
    radius: Lanes,
    inverse_radius: Lanes,
    axis_x: Lanes,
    axis_y: Lanes,
    axis_z: Lanes,
    cos_facing: Lanes,
    sin_facing: Lanes,
    cos_emission: Lanes,
    /// 1 for children with a light that emits to both sides.
    two_sided: Lanes,
    /// 0 for children that do not exist.
    intensity: Lanes,
    children: [Child; WIDTH],
    parent: Slot,
}

type Lanes = [f32; WIDTH];

#[derive(Clone, Copy, Debug)]
enum Child {
    None,
    Light(u32),
    Node(u32),
}

/// A node of the binary tree, depth first: the first child follows its parent. Bounds are a sphere and two cones.
#[derive(Clone, Copy, Debug)]
struct Node {
    centre: Vec3,
    radius_squared: f32,
    axis: Vec3,
    cos_facing: f32,
    sin_facing: f32,
    cos_emission: f32,
    intensity: f32,
    two_sided: bool,
    /// Distance to the second child; 0 for leaves.
    skip: u32,
    /// Index of a leaf's light.
    light: u32,
}

const NONE: Slot = Slot {
    node: u32::MAX,
    child: 0,
};
/// Number of parts of an extent between which the best split is searched.
const BUCKETS: usize = 12;
/// Least number of items for which the halves of a node are built in parallel.
const PARALLEL: usize = 4096;
/// Radians by which cones of facing are widened, so that rounding never excludes a light.
const SLACK: f32 = 1e-3;

impl Item {
    /// An item of one light.
    pub(super) fn light(bounds: LightBounds, light: usize) -> Self {
        Self {
            bounds,
            light: light as u32,
            members: Vec::new(),
        }
    }

    /// Adds a light to the mesh.
    pub(super) fn push(&mut self, light: Self) {
        if self.members.is_empty() {
            self.members
                .push(Self::light(self.bounds, self.light as usize));
        }
        self.bounds = self.bounds.union(&light.bounds);
        self.members.push(light);
    }

    /// Number of lights.
    pub(super) fn lights(&self) -> usize {
        self.members.len().max(1)
    }
}

impl LightBounds {
    fn union(&self, other: &Self) -> Self {
        let (axis, cos_facing) = self.facing(other);
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis,
            cos_facing,
            cos_emission: self.cos_emission.min(other.cos_emission),
            two_sided: self.two_sided || other.two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// The smallest cone around two cones [PBRT4 §3.8.4].
    fn facing(&self, other: &Self) -> (Vec3, f32) {
        let full = (self.axis, -1.0);
        if self.cos_facing <= -1.0 || other.cos_facing <= -1.0 {
            return full;
        }
        // Lights that emit to both sides face two directions, of which the nearer counts.
        let flip = self.two_sided && other.two_sided && self.axis.dot(other.axis) < 0.0;
        let towards = if flip { -other.axis } else { other.axis };
        let (a, b) = (angle(self.cos_facing), angle(other.cos_facing));
        let across = self.axis.cross(towards);
        let apart = across.length().atan2(self.axis.dot(towards));
        if (apart + b).min(PI) <= a {
            return (self.axis, self.cos_facing);
        }
        if (apart + a).min(PI) <= b {
            return (towards, other.cos_facing);
        }
        let half = 0.5 * (a + apart + b);
        let Some(across) = across.try_normalize().filter(|_| half < PI) else {
            return full;
        };
        let (sin, cos) = (half - a).sin_cos();
        let axis = cos * self.axis + sin * across.cross(self.axis);
        (axis.normalize(), half.cos())
    }

    fn centre(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }

    /// Cost of a cluster: intensity, spread of directions, size of the bounding sphere ([ContyKulla18] eq. 1, with the
    /// squared diagonal in place of the area of the box, which vanishes for lights in a row).
    fn cost(&self) -> f32 {
        let facing = angle(self.cos_facing);
        let all = (facing + angle(self.cos_emission)).min(PI);
        let sin = facing.sin();
        let solid_angle = TAU * (1.0 - self.cos_facing)
            + FRAC_PI_2
                * (2.0 * all * sin - (facing - 2.0 * all).cos() - 2.0 * facing * sin
                    + self.cos_facing);
        self.intensity * solid_angle * self.low.distance_squared(self.high)
    }
}

fn angle(cos: f32) -> f32 {
    cos.clamp(-1.0, 1.0).acos()
}

impl LightTree {
    /// Tree over at least one item; `lights` is the number of all lights of the scene.
    pub(super) fn new(mut items: Vec<Item>, lights: usize) -> Self {
        let (low, high) = items.iter().fold(
            (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY)),
            |(low, high), item| (low.min(item.bounds.low), high.max(item.bounds.high)),
        );
        // Least distance, a millionth of the lights' extent: intensities over squared distances stay finite.
        let least = (1e-12 * low.distance_squared(high)).max(1e-30);
        let (binary, _) = built(&mut items, least);
        let mut tree = Self {
            nodes: Vec::new(),
            leaves: vec![NONE; lights],
        };
        tree.collapse(&binary, 0, NONE);
        tree
    }

    /// Adds a wide node for the binary node `root`, and all nodes below it; returns its index. The descendants with the
    /// largest bounds are expanded first.
    fn collapse(&mut self, binary: &[Node], root: usize, parent: Slot) -> u32 {
        let mut children = vec![root];
        while children.len() < WIDTH {
            let size = |i: usize| binary[i].intensity * binary[i].radius_squared;
            let inner = (0..children.len()).filter(|&c| binary[children[c]].skip != 0);
            let Some(c) = inner.max_by(|&a, &b| size(children[a]).total_cmp(&size(children[b])))
            else {
                break;
            };
            let i = children[c];
            children[c] = i + 1;
            children.push(i + binary[i].skip as usize);
        }
        let lanes = |value: &dyn Fn(&Node) -> f32| -> Lanes {
            std::array::from_fn(|k| children.get(k).map_or(0.0, |&i| value(&binary[i])))
        };
        let node = self.nodes.len();
        self.nodes.push(WideNode {
            x: lanes(&|n| n.centre.x),
            y: lanes(&|n| n.centre.y),
            z: lanes(&|n| n.centre.z),
            radius: lanes(&|n| n.radius_squared.sqrt()),
            inverse_radius: lanes(&|n| 1.0 / n.radius_squared.sqrt()),
            axis_x: lanes(&|n| n.axis.x),
            axis_y: lanes(&|n| n.axis.y),
            axis_z: lanes(&|n| n.axis.z),
            cos_facing: lanes(&|n| n.cos_facing),
            sin_facing: lanes(&|n| n.sin_facing),
            cos_emission: lanes(&|n| n.cos_emission),
            two_sided: lanes(&|n| f32::from(n.two_sided)),
            intensity: lanes(&|n| n.intensity),
            children: [Child::None; WIDTH],
            parent,
        });
        for (k, &i) in children.iter().enumerate() {
            let slot = Slot {
                node: node as u32,
                child: k as u32,
            };
            let child = if binary[i].skip == 0 {
                self.leaves[binary[i].light as usize] = slot;
                Child::Light(binary[i].light)
            } else {
                Child::Node(self.collapse(binary, i, slot))
            };
            self.nodes[node].children[k] = child;
        }
        node as u32
    }

    /// Maps `u` in [0, 1) to a light, with the probability of the choice and the remainder of `u`.
    #[inline]
    pub(super) fn sample(&self, from: Vec3, mut u: f64) -> (usize, f64, f64) {
        let (mut node, mut pmf) = (0, 1.0);
        loop {
            let (weights, sum) = self.nodes[node].weights(from);
            let mut below = 0.0;
            let ends: [f64; WIDTH] = std::array::from_fn(|k| {
                below += f64::from(weights[k]);
                below
            });
            let place = u * sum;
            let passed = ends.iter().filter(|&&end| end <= place).count();
            // Rounding may pass all children; one without weight is never chosen.
            let mut child = passed.min(WIDTH - 1);
            while weights[child] <= 0.0 && child > 0 {
                child -= 1;
            }
            let weight = f64::from(weights[child]);
            let start = ends[child] - weight;
            pmf *= weight / sum;
            u = ((place - start) / weight).clamp(0.0, ALMOST_ONE);
            match self.nodes[node].children[child] {
                Child::Node(next) => node = next as usize,
                Child::Light(light) => return (light as usize, pmf, u),
                Child::None => return (0, 0.0, u),
            }
        }
    }

    /// Probability with which [`LightTree::sample`] draws a light: that of the same steps.
    #[inline]
    pub(super) fn pmf(&self, light: usize, from: Vec3) -> f64 {
        let slot = self.leaves[light];
        if slot.node == NONE.node {
            return 0.0;
        }
        self.pmf_of(slot, from)
    }

    fn pmf_of(&self, slot: Slot, from: Vec3) -> f64 {
        if slot.node == NONE.node {
            return 1.0;
        }
        let node = &self.nodes[slot.node as usize];
        let (weights, sum) = node.weights(from);
        // Multiplied from the root down, in the order of [`LightTree::sample`].
        self.pmf_of(node.parent, from) * (f64::from(weights[slot.child as usize]) / sum)
    }

    /// Bound of the irradiance at a point from all lights of the tree.
    #[inline]
    pub(super) fn irradiance(&self, from: Vec3) -> f32 {
        self.nodes[0].importance(from).iter().sum()
    }
}

impl WideNode {
    /// Weights with which the children are drawn, and their sum, which is positive.
    #[inline]
    fn weights(&self, from: Vec3) -> (Lanes, f64) {
        let importance = self.importance(from);
        let sum = total(&importance);
        if sum > 0.0 {
            return (importance, sum);
        }
        // No child can light the point although the parent's bound is positive: the sample carries no light.
        let sum = total(&self.intensity);
        if sum > 0.0 {
            return (self.intensity, sum);
        }
        let weights = self.children.map(|c| f32::from(!matches!(c, Child::None)));
        (weights, total(&weights))
    }

    /// Bounds of the irradiance at `from`, on a surface that faces the lights: the intensity at the least angle to
    /// where a light may face, over the squared distance of the centre ([ContyKulla18] eq. 3). Without branches, so
    /// that all lanes are computed at once.
    #[inline]
    fn importance(&self, from: Vec3) -> Lanes {
        let mut bounds = [0.0; WIDTH];
        for (k, bound) in bounds.iter_mut().enumerate() {
            let (x, y, z) = (from.x - self.x[k], from.y - self.y[k], from.z - self.z[k]);
            let squared = x * x + y * y + z * z;
            let inverse = 1.0 / squared.sqrt();
            let cos = x * self.axis_x[k] + y * self.axis_y[k] + z * self.axis_z[k];
            let cos = cos * inverse;
            let cos = cos + self.two_sided[k] * (cos.abs() - cos);
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            let (sin, cos) = less(sin, cos, self.sin_facing[k], self.cos_facing[k]);
            let subtended = self.radius[k] * inverse;
            let clear = (1.0 - subtended * subtended).max(0.0).sqrt();
            let (_, cos) = less(sin, cos, subtended, clear);
            let seen = if cos > self.cos_emission[k] { cos } else { 0.0 };
            // Inside of the sphere a light may be anywhere.
            let seen = if subtended >= 1.0 { 1.0 } else { seen };
            let inverse = inverse.min(self.inverse_radius[k]);
            *bound = self.intensity[k] * seen * (inverse * inverse);
        }
        bounds
    }
}

#[inline]
fn total(weights: &Lanes) -> f64 {
    weights.iter().map(|&w| f64::from(w)).sum()
}

impl Node {
    fn new(bounds: &LightBounds, least: f32, skip: u32, light: u32) -> Self {
        let facing = (angle(bounds.cos_facing) + SLACK).min(PI);
        Self {
            centre: bounds.centre(),
            radius_squared: (0.25 * bounds.low.distance_squared(bounds.high)).max(least),
            axis: bounds.axis,
            cos_facing: facing.cos(),
            sin_facing: facing.sin(),
            cos_emission: bounds.cos_emission,
            intensity: bounds.intensity,
            two_sided: bounds.two_sided,
            skip,
            light,
        }
    }
}

/// Sine and cosine of the difference of two angles, or of 0 if it is negative.
#[inline]
fn less(sin_a: f32, cos_a: f32, sin_b: f32, cos_b: f32) -> (f32, f32) {
    let (sin, cos) = (sin_a * cos_b - cos_a * sin_b, cos_a * cos_b + sin_a * sin_b);
    let none = cos_a >= cos_b;
    (if none { 0.0 } else { sin }, if none { 1.0 } else { cos })
}

/// Builds the binary nodes over the items, and returns their bounds too.
fn built(items: &mut [Item], least: f32) -> (Vec<Node>, LightBounds) {
    if let [item] = items {
        if !item.members.is_empty() {
            return built(&mut item.members, least);
        }
        return (
            vec![Node::new(&item.bounds, least, 0, item.light)],
            item.bounds,
        );
    }
    let middle = split(items);
    let (a, b) = items.split_at_mut(middle);
    let ((a, a_bounds), (b, b_bounds)) = if a.len() + b.len() < PARALLEL {
        (built(a, least), built(b, least))
    } else {
        rayon::join(|| built(a, least), || built(b, least))
    };
    let bounds = a_bounds.union(&b_bounds);
    let mut nodes = Vec::with_capacity(1 + a.len() + b.len());
    nodes.push(Node::new(&bounds, least, 1 + a.len() as u32, u32::MAX));
    nodes.extend(a);
    nodes.extend(b);
    (nodes, bounds)
}

/// Sorts the items into two parts, neither empty, and returns the length of the first.
fn split(items: &mut [Item]) -> usize {
    let n = items.len();
    let (low, high) = items.iter().fold(
        (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY)),
        |(low, high), item| {
            let centre = item.bounds.centre();
            (low.min(centre), high.max(centre))
        },
    );
    let extent = high - low;
    let widest = extent.max_element();
    let bucket = |item: &Item, axis: usize| {
        let place = (item.bounds.centre()[axis] - low[axis]) / extent[axis];
        ((place * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        if extent[axis] <= 0.0 || n < 4 {
            continue;
        }
        let mut parts = [None::<LightBounds>; BUCKETS];
        for item in items.iter() {
            let part = &mut parts[bucket(item, axis)];
            *part = joined(*part, Some(item.bounds));
        }
        let cost = |bounds: Option<LightBounds>| bounds.map(|b| b.cost());
        let (mut after, mut sum) = ([None; BUCKETS], None);
        for i in (1..BUCKETS).rev() {
            sum = joined(sum, parts[i]);
            after[i - 1] = cost(sum);
        }
        let mut sum = None;
        for i in 0..BUCKETS - 1 {
            sum = joined(sum, parts[i]);
            if let (Some(a), Some(b)) = (cost(sum), after[i]) {
                // Long thin clusters are cut across.
                let cost = (a + b) * widest / extent[axis];
                if cost < best.0 {
                    best = (cost, axis, i);
                }
            }
        }
    }
    if best.0 < f32::INFINITY {
        let (_, axis, last) = best;
        let mut middle = 0;
        for i in 0..n {
            if bucket(&items[i], axis) <= last {
                items.swap(i, middle);
                middle += 1;
            }
        }
        return middle;
    }
    // Few lights, or all in one place.
    let axis = (0..3).find(|&axis| extent[axis] == widest).unwrap_or(0);
    items.sort_by(|a, b| a.bounds.centre()[axis].total_cmp(&b.bounds.centre()[axis]));
    n / 2
}

fn joined(a: Option<LightBounds>, b: Option<LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}
