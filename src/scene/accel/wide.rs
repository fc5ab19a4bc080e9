//! The 8-wide tree: the binary tree of obvhs folded into nodes of eight boxes and leaves of four-triangle blocks, the
//! layout of the SIMD traversal.
//!
//! The fold minimises the surface-area cost exactly, by dynamic programming over the binary tree `[Ylitie17 §3.1]`.

use crate::math::Vec3;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams, aabb::Aabb};
use std::ops::Range;
use std::time::Duration;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a block.
pub(super) const LANES: usize = 4;
/// Marks a child that is a leaf: the rest is `first block << COUNT_BITS | blocks - 1`.
pub(super) const LEAF: u32 = 1 << 31;
/// Bits for the number of blocks of a leaf.
const COUNT_BITS: u32 = 2;
/// Most blocks in a leaf.
const MAX_BLOCKS: usize = 1 << COUNT_BITS;
/// Cost of testing a block of triangles over the cost of testing the eight boxes of a node.
const BLOCK_COST: f32 = 0.3;
/// Coordinates beyond this would overflow areas and slab distances.
const LIMIT: f32 = 1e17;

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

/// Four triangles, lane by lane; a free lane holds NaN, which no test accepts.
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
}

/// True if all coordinates are finite and small enough.
pub(super) fn usable(triangle: &[Vec3; 3]) -> bool {
    let ok = |p: &Vec3| p.to_array().iter().all(|x| x.abs() <= LIMIT);
    triangle.iter().all(ok)
}

/// A triangle's box, for the builder.
struct Bounded(Aabb);

impl Boundable for Bounded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Wide {
    /// Builds over all triangles whose coordinates are usable; the others keep their index and are never hit.
    pub(super) fn new(triangles: &[[Vec3; 3]]) -> Self {
        let ids: Vec<u32> = (0..triangles.len() as u32)
            .filter(|&i| usable(&triangles[i as usize]))
            .collect();
        if ids.is_empty() {
            return Self {
                nodes: Vec::new(),
                blocks: Vec::new(),
                stack: 0,
                bounds: (Vec3::ZERO, Vec3::ZERO),
            };
        }
        let boxes: Vec<Bounded> = ids
            .iter()
            .map(|&i| Bounded(Aabb::from_points(&triangles[i as usize].map(Into::into))))
            .collect();
        let params = BvhBuildParams {
            max_prims_per_leaf: 1,
            ..BvhBuildParams::medium_build()
        };
        let binary = build_bvh2(&boxes, params, &mut Duration::default());
        Fold::new(&binary).run(triangles, &ids)
    }
}

/// The least cost of representing a binary subtree by a forest of at most `i + 1` wide roots.
#[derive(Clone, Copy)]
struct Plan {
    cost: [f32; WIDTH - 1],
    /// Number of the `i + 1` roots (last: of the eight children) that go to the left child; 0: fewer roots are no worse.
    left: [u8; WIDTH],
    /// Triangles below.
    count: u32,
    /// True if one root is best as a leaf.
    leaf: bool,
}

struct Fold<'a> {
    binary: &'a Bvh2,
    plans: Vec<Plan>,
}

impl<'a> Fold<'a> {
    fn new(binary: &'a Bvh2) -> Self {
        const NONE: Plan = Plan {
            cost: [0.0; WIDTH - 1],
            left: [0; WIDTH],
            count: 0,
            leaf: true,
        };
        let mut fold = Self {
            binary,
            plans: vec![NONE; binary.nodes.len()],
        };
        // Children before parents: parents in order of discovery, backwards.
        let mut order = Vec::with_capacity(binary.nodes.len());
        order.push(0u32);
        let mut next = 0;
        while next < order.len() {
            let node = &binary.nodes[order[next] as usize];
            if !node.is_leaf() {
                order.extend([node.first_index, node.first_index + 1]);
            }
            next += 1;
        }
        for &n in order.iter().rev() {
            fold.plans[n as usize] = fold.plan(n as usize);
        }
        fold
    }

    fn plan(&self, n: usize) -> Plan {
        let node = &self.binary.nodes[n];
        let area = node.aabb.half_area();
        if node.is_leaf() {
            return Plan {
                cost: [area * BLOCK_COST; WIDTH - 1],
                left: [0; WIDTH],
                count: node.prim_count,
                leaf: true,
            };
        }
        let l = &self.plans[node.first_index as usize];
        let r = &self.plans[node.first_index as usize + 1];
        let mut left = [0u8; WIDTH];
        let mut cost = [f32::INFINITY; WIDTH];
        for roots in 2..=WIDTH {
            for k in 1..roots {
                let c = l.cost[k - 1] + r.cost[roots - k - 1];
                if c < cost[roots - 1] {
                    cost[roots - 1] = c;
                    left[roots - 1] = k as u8;
                }
            }
        }
        let count = l.count + r.count;
        let blocks = (count as usize).div_ceil(LANES);
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
        let mut out = [0.0; WIDTH - 1];
        out.copy_from_slice(&cost[..WIDTH - 1]);
        Plan {
            cost: out,
            left,
            count,
            leaf: leaf_cost <= inner,
        }
    }

    /// The roots that represent subtree `n` when at most `roots` may be used.
    fn roots(&self, n: u32, mut roots: usize, out: &mut Vec<u32>) {
        let plan = &self.plans[n as usize];
        while roots > 1 && plan.left[roots - 1] == 0 {
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
        let left = self.plans[n as usize].left[roots - 1] as usize;
        self.roots(first, left, out);
        self.roots(first + 1, roots - left, out);
    }

    fn run(&self, triangles: &[[Vec3; 3]], ids: &[u32]) -> Wide {
        let mut nodes = vec![Node::EMPTY];
        let mut blocks = Vec::new();
        let mut depth = 1;
        // (binary subtree, its wide node, depth)
        let mut todo = vec![(0u32, 0usize, 1usize)];
        let mut roots = Vec::with_capacity(WIDTH);
        while let Some((n, target, at)) = todo.pop() {
            depth = depth.max(at);
            roots.clear();
            if self.plans[n as usize].leaf {
                roots.push(n); // only the root of a tiny scene
            } else {
                self.split(n, WIDTH, &mut roots);
            }
            for (slot, &child) in roots.iter().enumerate() {
                let plan = &self.plans[child as usize];
                nodes[target].set_box(slot, &self.binary.nodes[child as usize].aabb);
                nodes[target].children[slot] = if plan.leaf {
                    self.leaf(child, triangles, ids, &mut blocks)
                } else {
                    todo.push((child, nodes.len(), at + 1));
                    nodes.push(Node::EMPTY);
                    nodes.len() as u32 - 1
                };
            }
        }
        let whole = &self.binary.nodes[0].aabb;
        Wide {
            nodes,
            blocks,
            stack: depth * (WIDTH - 1) + WIDTH,
            bounds: (whole.min.into(), whole.max.into()),
        }
    }

    fn leaf(&self, n: u32, triangles: &[[Vec3; 3]], ids: &[u32], blocks: &mut Vec<Block>) -> u32 {
        let first = blocks.len() as u32;
        let mut found = 0;
        let mut todo = vec![n];
        while let Some(n) = todo.pop() {
            let node = &self.binary.nodes[n as usize];
            if !node.is_leaf() {
                todo.extend([node.first_index + 1, node.first_index]);
                continue;
            }
            for i in node.first_index..node.first_index + node.prim_count {
                let id = ids[self.binary.primitive_indices[i as usize] as usize];
                if found % LANES == 0 {
                    blocks.push(Block::EMPTY);
                }
                let block = blocks.last_mut().expect("one was just pushed");
                for (corner, p) in block.corners.iter_mut().zip(&triangles[id as usize]) {
                    for axis in 0..3 {
                        corner[axis][found % LANES] = p[axis];
                    }
                }
                block.ids[found % LANES] = id;
                found += 1;
            }
        }
        LEAF | first << COUNT_BITS | (found.div_ceil(LANES) as u32 - 1)
    }
}
