//! The light tree: a light is drawn by a bound of what it sends to a point, from its place, its distance and the way it
//! faces `[ContyKulla18]`, `[PBRT4 §12.6.3]`.

use crate::math::Vec3;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Bounds of some lights: place, directions, strength.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBounds {
    /// Corners of the box.
    pub low: Vec3,
    pub high: Vec3,
    /// Cone of the directions in which the lights face, and the cosine of its half angle.
    pub axis: Vec3,
    pub cos_facing: f32,
    /// Cosine of the angle to its facing up to which a light shines.
    pub cos_emission: f32,
    /// True if a light shines to both sides.
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

/// Tree over lights at finite distance, depth first: the first child follows its parent.
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// Place of each light's leaf, by index of the light; [`NONE`] for lights that are not in the tree.
    leaves: Vec<u32>,
}

/// A node's bounds as a sphere and two cones.
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

const NONE: u32 = u32::MAX;
/// Parts into which an extent is cut to find the best split.
const BUCKETS: usize = 12;
/// Lights from which the halves of a node are built in parallel.
const PARALLEL: usize = 4096;
/// Radians by which cones of facing are widened, so that rounding never excludes a light.
const SLACK: f32 = 1e-3;
/// Largest double-precision number below 1.
const ALMOST_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

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
        // Both sides of a light face somewhere: the nearer one counts.
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
    /// squared diagonal for the area of the box, which vanishes for lights in a row).
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
        // No light is nearer than a millionth of their extent: intensities over squared distances stay finite.
        let least = (1e-12 * low.distance_squared(high)).max(1e-30);
        let (nodes, _) = built(&mut items, least);
        let mut leaves = vec![NONE; lights];
        for (i, node) in nodes.iter().enumerate().filter(|(_, n)| n.skip == 0) {
            leaves[node.light as usize] = i as u32;
        }
        Self { nodes, leaves }
    }

    /// Maps `u` in [0, 1) to a light, with the probability of the choice and the remainder of `u`.
    #[inline]
    pub(super) fn sample(&self, from: Vec3, mut u: f64) -> (usize, f64, f64) {
        let (mut i, mut pmf) = (0, 1.0);
        while self.nodes[i].skip != 0 {
            let p = self.first(i, from);
            u = u.min(ALMOST_ONE);
            if u < p {
                (i, u, pmf) = (i + 1, u / p, pmf * p);
            } else {
                let skip = self.nodes[i].skip as usize;
                (i, u, pmf) = (i + skip, (u - p) / (1.0 - p), pmf * (1.0 - p));
            }
        }
        (self.nodes[i].light as usize, pmf, u.min(ALMOST_ONE))
    }

    /// Probability with which [`LightTree::sample`] draws a light: the same steps, towards the light's leaf.
    #[inline]
    pub(super) fn pmf(&self, light: usize, from: Vec3) -> f64 {
        let leaf = self.leaves[light];
        if leaf == NONE {
            return 0.0;
        }
        let (mut i, mut pmf) = (0, 1.0);
        while self.nodes[i].skip != 0 {
            let p = self.first(i, from);
            let second = i + self.nodes[i].skip as usize;
            if (leaf as usize) < second {
                (i, pmf) = (i + 1, pmf * p);
            } else {
                (i, pmf) = (second, pmf * (1.0 - p));
            }
        }
        pmf
    }

    /// Bound of the irradiance at a point from all lights of the tree.
    #[inline]
    pub(super) fn irradiance(&self, from: Vec3) -> f32 {
        match self.nodes[0].skip {
            0 => self.nodes[0].importance(from),
            skip => self.nodes[1].importance(from) + self.nodes[skip as usize].importance(from),
        }
    }

    /// Probability of the first child of an inner node.
    #[inline]
    fn first(&self, i: usize, from: Vec3) -> f64 {
        let (a, b) = (
            &self.nodes[i + 1],
            &self.nodes[i + self.nodes[i].skip as usize],
        );
        let share = |a: f32, b: f32| f64::from(a) / (f64::from(a) + f64::from(b));
        let p = share(a.importance(from), b.importance(from));
        if p.is_finite() {
            return p;
        }
        // Neither can light the point, which the bounds of their parent did not say: the sample will be dark.
        let p = share(a.intensity, b.intensity);
        if p.is_finite() { p } else { 0.5 }
    }
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

    /// Bound of the irradiance at `from`, on a surface that faces the lights: the intensity at the least angle to where
    /// a light may face, over the squared distance of the centre ([ContyKulla18] eq. 3).
    #[inline]
    fn importance(&self, from: Vec3) -> f32 {
        let to = from - self.centre;
        let squared = to.length_squared();
        // Inside of the sphere a light may be anywhere.
        if squared <= self.radius_squared {
            return self.intensity / self.radius_squared;
        }
        let cos = to.dot(self.axis) / squared.sqrt();
        let cos = if self.two_sided { cos.abs() } else { cos };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (sin, cos) = less(sin, cos, self.sin_facing, self.cos_facing);
        let subtended = self.radius_squared / squared;
        let (_, cos) = less(sin, cos, subtended.sqrt(), (1.0 - subtended).sqrt());
        if cos <= self.cos_emission {
            return 0.0;
        }
        self.intensity * cos / squared
    }
}

/// Sine and cosine of the difference of two angles, or of 0 if it is negative.
#[inline]
fn less(sin_a: f32, cos_a: f32, sin_b: f32, cos_b: f32) -> (f32, f32) {
    if cos_a >= cos_b {
        (0.0, 1.0)
    } else {
        (sin_a * cos_b - cos_a * sin_b, cos_a * cos_b + sin_a * sin_b)
    }
}

/// Nodes over the items and their bounds.
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
    nodes.push(Node::new(&bounds, least, 1 + a.len() as u32, NONE));
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
