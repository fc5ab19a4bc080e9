//! The 8-wide tree: the binary tree of obvhs folded into nodes of eight boxes and leaves of blocks, the layout of the
//! SIMD traversal. A block is four triangles, or an instance.
//!
//! The fold minimises the surface-area cost exactly, by dynamic programming over the binary tree `[Ylitie17 §3.1]`.

use super::huge_list;
use crate::math::{DVec3, Vec3};
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams, aabb::Aabb};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a block.
pub(super) const LANES: usize = 4;
/// Marks a child that is a leaf: the rest is `first block << COUNT_BITS | blocks - 1`.
pub(super) const LEAF: u32 = 1 << 31;
/// Bits for the number of blocks of a leaf.
const COUNT_BITS: u32 = 2;
/// Coordinates beyond this would overflow areas and slab distances.
pub(super) const LIMIT: f32 = 1e17;

/// The blocks of a leaf.
#[inline(always)]
pub(super) fn leaf_blocks(leaf: u32) -> Range<usize> {
    let first = ((leaf & !LEAF) >> COUNT_BITS) as usize;
    let count = (leaf & ((1 << COUNT_BITS) - 1)) as usize + 1;
    first..first + count
}

/// Eight boxes and their contents: four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(256))]
pub(super) struct Node {
    /// Lower and upper x, lower and upper y, lower and upper z; an empty slot has lower = +∞, upper = −∞.
    pub(super) planes: [[f32; WIDTH]; 6],
    /// Index of a node, or a leaf.
    pub(super) children: [u32; WIDTH],
}

/// Four triangles, lane by lane; an empty lane has NaN, which no test accepts. For an instance all lanes are empty, the
/// first of `ids` is its number and the last [`INSTANCE`].
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Block {
    /// Corner, axis, lane.
    pub(super) corners: [[[f32; LANES]; 3]; 3],
    /// Index of each triangle.
    pub(super) ids: [u32; LANES],
}

/// The tree.
pub(super) struct Wide {
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    /// Entries that the traversal's stack must hold.
    pub(super) stack: usize,
    /// Lower and upper corner of everything.
    pub(super) bounds: (Vec3, Vec3),
}

impl Node {
    const EMPTY: Self = {
        let (lo, hi) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self {
            planes: [lo, hi, lo, hi, lo, hi],
            children: [LEAF; WIDTH],
        }
    };

    /// The greatest p · `dir` over the points p of each child's box, with the child.
    fn reaches(&self, dir: DVec3) -> impl Iterator<Item = (f64, u32)> {
        let along = move |slot: usize, axis: usize| {
            let side = |side: usize| dir[axis] * f64::from(self.planes[2 * axis + side][slot]);
            side(0).max(side(1))
        };
        let reach = move |slot: usize| along(slot, 0) + along(slot, 1) + along(slot, 2);
        (0..WIDTH)
            .filter(|&slot| self.planes[0][slot] <= self.planes[1][slot])
            .map(move |slot| (reach(slot), self.children[slot]))
    }

    fn set_box(&mut self, slot: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.planes[2 * axis][slot] = aabb.min[axis];
            self.planes[2 * axis + 1][slot] = aabb.max[axis];
        }
    }
}

impl Block {
    const EMPTY: Self = Self {
        corners: [[[f32::NAN; LANES]; 3]; 3],
        ids: [0; LANES],
    };

    /// Number of the instance, if the block is one.
    #[inline(always)]
    pub(super) fn instance(&self) -> Option<u32> {
        (self.ids[LANES - 1] == INSTANCE).then_some(self.ids[0])
    }
}

/// Mark of an instance in [`Block::ids`]; indices of triangles are lower.
const INSTANCE: u32 = u32::MAX;

/// Number of primitives for which an instance counts: more than a leaf may have, so that it gets its own.
const WEIGHT: u8 = (LANES << COUNT_BITS) as u8 + 1;

/// Cost of an instance over the cost of testing the eight boxes of a node.
const INSTANCE_COST: f32 = 4.0;

/// Least number of primitives for the fast build, which takes half the time: the surface-area cost is 1 % higher, and
/// rays take equally long within 1 %.
const MANY: usize = 1 << 17;

/// Bounds of nothing.
const EMPTY_BOUNDS: (Vec3, Vec3) = (Vec3::ZERO, Vec3::ZERO);

/// True if all coordinates are finite and small enough.
pub(super) fn usable(triangle: &[Vec3; 3]) -> bool {
    let ok = |p: &Vec3| p.to_array().iter().all(|x| x.abs() <= LIMIT);
    triangle.iter().all(ok)
}

/// Most blocks in a leaf.
const MAX_BLOCKS: usize = 1 << COUNT_BITS;

/// Cost of a block of triangles over the cost of testing the eight boxes of a node.
const BLOCK_COST: f32 = 0.3;

/// A primitive's box for the builder, without the padding of [`Aabb`].
struct Bounded {
    low: [f32; 3],
    high: [f32; 3],
}

impl Bounded {
    fn new(low: Vec3, high: Vec3) -> Self {
        Self {
            low: low.to_array(),
            high: high.to_array(),
        }
    }
}

impl Boundable for Bounded {
    fn aabb(&self) -> Aabb {
        Aabb::new(self.low.into(), self.high.into())
    }
}

impl Wide {
    /// Builds over `count` triangles, and over instances with these lower and upper corners of boxes. Triangles with a
    /// coordinate that is not usable keep their index and are never hit.
    pub(super) fn new(
        count: usize,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
        instances: &[(Vec3, Vec3)],
    ) -> Self {
        let bounded = |i: u32| {
            let triangle @ [a, b, c] = corners(i);
            usable(&triangle).then(|| Bounded::new(a.min(b).min(c), a.max(b).max(c)))
        };
        let all = 0..count as u32;
        let boxes: Option<Vec<_>> = all.clone().into_par_iter().map(bounded).collect();
        // Indices of the usable triangles; `None` if all are usable.
        let (ids, mut boxes): (Option<Vec<u32>>, Vec<Bounded>) = match boxes {
            Some(boxes) => (None, boxes),
            None => {
                let some = all.filter_map(|i| Some((i, bounded(i)?)));
                let (ids, boxes) = some.unzip();
                (Some(ids), boxes)
            }
        };
        let id = |i: u32| ids.as_ref().map_or(i, |ids| ids[i as usize]);
        let triangles = boxes.len() as u32;
        boxes.extend(instances.iter().map(|&(low, high)| Bounded::new(low, high)));
        Self::build(boxes, triangles, |primitives, blocks| {
            let instances = primitives.extract_if(.., |i| *i >= triangles);
            blocks.extend(instances.map(|i| Block {
                ids: [i - triangles, 0, 0, INSTANCE],
                ..Block::EMPTY
            }));
            for group in primitives.chunks(LANES) {
                let mut block = Block::EMPTY;
                for (lane, &i) in group.iter().enumerate() {
                    for (corner, p) in block.corners.iter_mut().zip(corners(id(i))) {
                        for axis in 0..3 {
                            corner[axis][lane] = p[axis];
                        }
                    }
                    block.ids[lane] = id(i);
                }
                blocks.push(block);
            }
        })
    }

    /// An empty tree with the bounds of these triangles and instances.
    pub(super) fn bounds_only(
        triangles: impl Iterator<Item = [Vec3; 3]>,
        instances: &[(Vec3, Vec3)],
    ) -> Self {
        let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let boxes = instances.iter().flat_map(|&(low, high)| [low, high]);
        let (low, high) = (triangles.filter(usable).flatten().chain(boxes))
            .fold(start, |(low, high), p| (low.min(p), high.max(p)));
        Self {
            bounds: if low.x <= high.x {
                (low, high)
            } else {
                EMPTY_BOUNDS
            },
            ..Self::empty()
        }
    }
}

impl Wide {
    /// The greatest p · `dir` over the points p of all triangles, or a slightly larger bound: the search, farthest box
    /// first, ends after a few nodes. The tree must have no instances.
    pub(super) fn reach(&self, dir: DVec3) -> f64 {
        /// Largest number of nodes and leaves visited.
        const MAX_VISITS: usize = 24;
        let mut todo = vec![(f64::INFINITY, 0)];
        let mut reach = f64::NEG_INFINITY;
        for _ in 0..MAX_VISITS {
            let farthest = (0..todo.len()).max_by(|&a, &b| todo[a].0.total_cmp(&todo[b].0));
            let Some((bound, child)) = farthest.map(|k| todo.swap_remove(k)) else {
                return reach;
            };
            if bound <= reach {
                return reach;
            }
            if child & LEAF == 0 {
                todo.extend(self.nodes[child as usize].reaches(dir));
                continue;
            }
            for block in &self.blocks[leaf_blocks(child)] {
                for [x, y, z] in block.corners {
                    for lane in 0..LANES {
                        let p = Vec3::new(x[lane], y[lane], z[lane]).as_dvec3();
                        // `max` ignores the NaN of empty lanes.
                        reach = reach.max(p.dot(dir));
                    }
                }
            }
        }
        todo.iter()
            .fold(reach, |reach, (bound, _)| reach.max(*bound))
    }

    fn empty() -> Self {
        Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            stack: 0,
            bounds: EMPTY_BOUNDS,
        }
    }

    /// Builds over boxes, the first `triangles` of triangles and the rest of instances; `fill` appends the blocks of a
    /// leaf's primitives.
    fn build(
        boxes: Vec<Bounded>,
        triangles: u32,
        fill: impl FnMut(&mut Vec<u32>, &mut Vec<Block>),
    ) -> Self {
        if boxes.is_empty() {
            return Self::empty();
        }
        let (preset, second_pass) = match boxes.len() < MANY {
            true => (BvhBuildParams::medium_build(), 2.0),
            false => (BvhBuildParams::fast_build(), 0.0),
        };
        let params = BvhBuildParams {
            max_prims_per_leaf: 1,
            reinsertion_batch_ratio: 0.05,
            post_collapse_reinsertion_batch_ratio_multiplier: second_pass,
            ..preset
        };
        let mut binary = build_bvh2(&boxes, params, &mut Duration::default());
        drop(boxes);
        // The fold does not read these lists, which have an entry per triangle.
        binary.parents = Vec::new();
        binary.primitives_to_nodes = Vec::new();
        Fold::new(&binary, triangles).run(fill)
    }
}

/// Least costs of representing a binary subtree by a forest of at most `i + 1` wide roots, and its number of primitives
/// (at most 255).
struct Costs {
    forest: [f32; WIDTH - 1],
    count: u8,
}

/// Choices that give the least costs of an inner node: for `i + 2` roots (last: for the eight children) the number of
/// roots in the left child, in three bits. 0: fewer roots are no worse; last: the subtree is best as a leaf.
struct Plan(AtomicU32);

impl Plan {
    const BITS: u32 = 3;

    fn left(&self, roots: usize) -> usize {
        let at = (roots - 2) as u32 * Self::BITS;
        (self.0.load(Ordering::Relaxed) >> at) as usize & ((1 << Self::BITS) - 1)
    }
}

struct Fold<'a> {
    binary: &'a Bvh2,
    /// Number of triangles, which come before the instances.
    triangles: u32,
    /// Plans of the inner nodes, in the order of the pairs of children.
    plans: Vec<Plan>,
}

impl<'a> Fold<'a> {
    /// Number of levels at which both children are solved in parallel.
    const FORKS: u32 = 8;

    fn new(binary: &'a Bvh2, triangles: u32) -> Self {
        let plans = || Plan(AtomicU32::new(0));
        let fold = Self {
            binary,
            triangles,
            plans: std::iter::repeat_with(plans)
                .take(binary.nodes.len() / 2)
                .collect(),
        };
        fold.solve(0, Self::FORKS);
        fold
    }

    /// Plan of an inner node: pairs of children begin at odd places.
    fn plan(&self, n: u32) -> &Plan {
        &self.plans[self.binary.nodes[n as usize].first_index as usize / 2]
    }

    /// Plans a subtree and returns its costs.
    fn solve(&self, n: u32, forks: u32) -> Costs {
        let node = |n: u32| &self.binary.nodes[n as usize];
        if forks > 0 && !node(n).is_leaf() {
            let first = node(n).first_index;
            let side = |n| move || self.solve(n, forks - 1);
            let (left, right) = rayon::join(side(first), side(first + 1));
            return self.choose(n, &left, &right);
        }
        /// Marks a node whose children are solved.
        const READY: u32 = 1 << 31;
        let (mut todo, mut done) = (vec![n], Vec::new());
        while let Some(n) = todo.pop() {
            if n & READY != 0 {
                let (right, left) = (done.pop(), done.pop());
                let (left, right) = left.zip(right).expect("both children are done");
                done.push(self.choose(n & !READY, &left, &right));
            } else if node(n).is_leaf() {
                done.push(self.leaf(n));
            } else {
                let first = node(n).first_index;
                todo.extend([n | READY, first + 1, first]);
            }
        }
        done.pop().expect("the subtree is done")
    }

    /// Costs of a leaf.
    fn leaf(&self, n: u32) -> Costs {
        let node = &self.binary.nodes[n as usize];
        let first = self.binary.primitive_indices[node.first_index as usize];
        let (cost, count) = match first < self.triangles {
            true => (BLOCK_COST, node.prim_count.min(255) as u8),
            false => (INSTANCE_COST, WEIGHT),
        };
        Costs {
            forest: [node.aabb().half_area() * cost; WIDTH - 1],
            count,
        }
    }

    /// Plans an inner node by the costs of its children.
    fn choose(&self, n: u32, l: &Costs, r: &Costs) -> Costs {
        let area = self.binary.nodes[n as usize].aabb().half_area();
        let mut left = [0u32; WIDTH];
        let mut cost = [f32::INFINITY; WIDTH];
        for roots in 2..=WIDTH {
            for k in 1..roots {
                let c = l.forest[k - 1] + r.forest[roots - k - 1];
                let better = c < cost[roots - 1];
                cost[roots - 1] = if better { c } else { cost[roots - 1] };
                left[roots - 1] = if better { k as u32 } else { left[roots - 1] };
            }
        }
        let count = l.count.saturating_add(r.count);
        let blocks = usize::from(count).div_ceil(LANES);
        let inner = cost[WIDTH - 1] + area;
        let leaf_cost = if blocks <= MAX_BLOCKS {
            area * BLOCK_COST * blocks as f32
        } else {
            f32::INFINITY
        };
        cost[0] = inner.min(leaf_cost);
        for roots in 1..WIDTH - 1 {
            if cost[roots - 1] <= cost[roots] {
                cost[roots] = cost[roots - 1];
                left[roots] = 0;
            }
        }
        if leaf_cost <= inner {
            left[WIDTH - 1] = 0;
        }
        let packed = (left[1..].iter().rev()).fold(0, |bits, &k| bits << Plan::BITS | k);
        self.plan(n).0.store(packed, Ordering::Relaxed);
        let mut forest = [0.0; WIDTH - 1];
        forest.copy_from_slice(&cost[..WIDTH - 1]);
        Costs { forest, count }
    }

    /// True if a binary subtree is best as a leaf.
    fn is_leaf(&self, n: u32) -> bool {
        self.binary.nodes[n as usize].is_leaf() || self.plan(n).left(WIDTH) == 0
    }

    /// The roots that represent subtree `n` when at most `roots` may be used.
    fn roots(&self, n: u32, mut roots: usize, out: &mut Vec<u32>) {
        if self.binary.nodes[n as usize].is_leaf() {
            roots = 1;
        }
        while roots > 1 && self.plan(n).left(roots) == 0 {
            roots -= 1;
        }
        if roots == 1 {
            out.push(n);
        } else {
            self.split(n, roots, out);
        }
    }

    fn split(&self, n: u32, roots: usize, out: &mut Vec<u32>) {
        let first = self.binary.nodes[n as usize].first_index;
        let left = self.plan(n).left(roots);
        self.roots(first, left, out);
        self.roots(first + 1, roots - left, out);
    }

    fn run(&self, mut fill: impl FnMut(&mut Vec<u32>, &mut Vec<Block>)) -> Wide {
        // Capacity for twice as many blocks as full ones, and a node for every eight: enough for nearly all scenes.
        // Unwritten memory is not committed, and lists that grow would copy.
        let instances = self.binary.primitive_indices.len() - self.triangles as usize;
        let most = 2 * (self.triangles as usize).div_ceil(LANES) + 2 * instances;
        let (mut nodes, mut blocks) = (huge_list(most.div_ceil(WIDTH)), huge_list(most));
        nodes.push(Node::EMPTY);
        let mut depth = 1;
        // (binary subtree, its wide node, depth)
        let mut todo = vec![(0u32, 0usize, 1usize)];
        let mut roots = Vec::with_capacity(WIDTH);
        let (mut primitives, mut inner) = (Vec::new(), Vec::new());
        while let Some((n, target, at)) = todo.pop() {
            depth = depth.max(at);
            roots.clear();
            if self.is_leaf(n) {
                roots.push(n); // only the root of a tiny scene
            } else {
                self.split(n, WIDTH, &mut roots);
            }
            for (slot, &child) in roots.iter().enumerate() {
                nodes[target].set_box(slot, self.binary.nodes[child as usize].aabb());
                nodes[target].children[slot] = if self.is_leaf(child) {
                    let first = blocks.len();
                    self.primitives(child, &mut inner, &mut primitives);
                    fill(&mut primitives, &mut blocks);
                    LEAF | (first as u32) << COUNT_BITS | (blocks.len() - first - 1) as u32
                } else {
                    todo.push((child, nodes.len(), at + 1));
                    nodes.push(Node::EMPTY);
                    nodes.len() as u32 - 1
                };
            }
        }
        let whole = self.binary.nodes[0].aabb();
        Wide {
            nodes,
            blocks,
            stack: depth * (WIDTH - 1) + WIDTH,
            bounds: (whole.min.into(), whole.max.into()),
        }
    }

    /// The primitives of a binary subtree, left to right; `todo` is scratch memory.
    fn primitives(&self, n: u32, todo: &mut Vec<u32>, out: &mut Vec<u32>) {
        out.clear();
        todo.push(n);
        while let Some(n) = todo.pop() {
            let node = &self.binary.nodes[n as usize];
            if !node.is_leaf() {
                todo.extend([node.first_index + 1, node.first_index]);
                continue;
            }
            let first = node.first_index as usize;
            out.extend(&self.binary.primitive_indices[first..first + node.prim_count as usize]);
        }
    }
}
