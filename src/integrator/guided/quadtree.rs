//! Distribution of directions: a quadtree over the sphere.
//!
//! The square (z, φ) ↦ ((z + 1)/2, φ/2π) preserves area up to a factor: an area a of the square is a solid angle 4πa. A
//! node has four quarters; each leaf has a constant density.

use crate::math::warp::SPHERE_PDF;
use crate::math::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Quarters with a larger share of the whole are divided `[Müller17 §3.2]`.
const MAX_SHARE: f32 = 0.01;

/// Most nodes above a quarter: single precision resolves no smaller ones.
const MAX_DEPTH: u32 = 20;

/// Most nodes of a tree: with shares of at most 1 % few trees come near.
const MAX_NODES: usize = 256;

/// Most bytes of a density and the sums for the next.
pub(super) const MAX_TREE_BYTES: usize =
    MAX_NODES * (2 * size_of::<Node>() + size_of::<[f64; 4]>());

/// Records, of mean value, added to every quarter of a node, so that directions without records keep a positive
/// density.
const PRIOR: f64 = 1.0;

/// Four quarters of a square: index 2 i + j for half i along x and half j along y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Node {
    mass: [f32; 4],
    /// Index of the node that divides the quarter; 0 for a leaf.
    child: [u32; 4],
}

impl Node {
    fn total(&self) -> f32 {
        (self.mass[0] + self.mass[1]) + (self.mass[2] + self.mass[3])
    }
}

/// A density over directions.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quadtree {
    /// The root first; a node before its children.
    nodes: Vec<Node>,
}

impl Default for Quadtree {
    /// A tree of four quarters without mass.
    fn default() -> Self {
        Self {
            nodes: vec![Node::default()],
        }
    }
}

/// The point of the square for a direction; both coordinates are in [0, 1).
#[inline]
pub(crate) fn square(dir: Vec3) -> Vec2 {
    let x = (0.5 * dir.z + 0.5).clamp(0.0, 1.0f32.next_down());
    let turn = dir.y.atan2(dir.x) / TAU;
    let y = if turn < 0.0 { turn + 1.0 } else { turn };
    Vec2::new(x, y.min(1.0f32.next_down()))
}

/// The direction for a point of the square.
#[inline]
pub(crate) fn direction(p: Vec2) -> Vec3 {
    let z = 2.0 * p.x - 1.0;
    let r = (4.0 * p.x * (1.0 - p.x)).max(0.0).sqrt();
    let (sin, cos) = (TAU * p.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Index of the quarter that contains a point, which is mapped to the quarter's own square.
#[inline]
fn enter(p: &mut Vec2) -> usize {
    let mut quarter = 0;
    for (axis, bit) in [(0, 2), (1, 1)] {
        p[axis] *= 2.0;
        if p[axis] >= 1.0 {
            p[axis] -= 1.0;
            quarter |= bit;
        }
    }
    quarter
}

impl Quadtree {
    /// True if nothing was added: there is no density.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.nodes[0].total() <= 0.0
    }

    /// Density of a direction per steradian; 0 for an empty tree.
    #[inline]
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let (mut p, mut node, mut pdf) = (square(dir), &self.nodes[0], SPHERE_PDF);
        loop {
            let quarter = enter(&mut p);
            pdf *= 4.0 * node.mass[quarter] / node.total();
            match node.child[quarter] {
                0 => return pdf,
                // Nodes below a quarter without mass would give 0/0.
                _ if pdf == 0.0 => return pdf,
                child => node = &self.nodes[child as usize],
            }
        }
    }

    /// A direction from random numbers in [0, 1)², and its density per steradian; for a tree that is not empty.
    #[inline]
    pub(crate) fn sample(&self, mut u: Vec2) -> (Vec3, f32) {
        let (mut low, mut side, mut node) = (Vec2::ZERO, 1.0, &self.nodes[0]);
        let mut pdf = SPHERE_PDF;
        loop {
            let m = &node.mass;
            let mut choose = |axis: usize, a: f32, b: f32| {
                let first = a / (a + b);
                // Rounding may bring a number to 1; a half without mass is never chosen.
                let second = u[axis] >= first && b > 0.0;
                u[axis] = if second {
                    (u[axis] - first) / (1.0 - first)
                } else {
                    u[axis] / first
                }
                .clamp(0.0, 1.0f32.next_down());
                usize::from(second)
            };
            let right = choose(0, m[0] + m[1], m[2] + m[3]);
            let up = choose(1, m[2 * right], m[2 * right + 1]);
            side *= 0.5;
            low += side * Vec2::new(right as f32, up as f32);
            pdf *= 4.0 * m[2 * right + up] / node.total();
            match node.child[2 * right + up] {
                0 => {
                    let p = (low + side * u).min(Vec2::splat(1.0f32.next_down()));
                    return (direction(p), pdf);
                }
                child => node = &self.nodes[child as usize],
            }
        }
    }
}

/// Sums of the values of records, from which a [`Quadtree`] is made.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sums {
    /// Σ v of the values in a quarter.
    tree: Quadtree,
    /// Σ v².
    squares: Vec<[f64; 4]>,
}

impl Default for Sums {
    /// Four quarters without records.
    fn default() -> Self {
        Self {
            tree: Quadtree::default(),
            squares: vec![[0.0; 4]],
        }
    }
}

impl Sums {
    /// Edge of the leaf around a point.
    #[inline]
    pub(crate) fn leaf_edge(&self, mut p: Vec2) -> f32 {
        let nodes = &self.tree.nodes;
        let (mut side, mut node) = (0.5, &nodes[0]);
        loop {
            match node.child[enter(&mut p)] {
                0 => return side,
                child => node = &nodes[child as usize],
            }
            side *= 0.5;
        }
    }

    /// Adds a value, above 0, at a point.
    #[inline]
    pub(crate) fn add(&mut self, mut p: Vec2, value: f32) {
        // So that no sum of values overflows.
        let value = value.min(1e30);
        let (nodes, mut at) = (&mut self.tree.nodes, 0);
        loop {
            let quarter = enter(&mut p);
            match nodes[at].child[quarter] {
                0 => {
                    nodes[at].mass[quarter] += value;
                    self.squares[at][quarter] += f64::from(value).powi(2);
                    return;
                }
                child => at = child as usize,
            }
        }
    }

    /// The density of these sums, which are reset for the next iteration: empty, and refined where the density is high.
    pub(crate) fn finish(&mut self) -> Quadtree {
        let nodes = &mut self.tree.nodes;
        for at in (0..nodes.len()).rev() {
            for quarter in 0..4 {
                let child = nodes[at].child[quarter] as usize;
                if child != 0 {
                    nodes[at].mass[quarter] = nodes[child].total();
                    self.squares[at][quarter] = self.squares[child].iter().sum();
                }
            }
        }
        let density = self.density();
        *self = Self::refined(&density);
        density
    }

    /// The density of these sums, in which every node splits its mass by its quarters' records and a [prior](PRIOR).
    /// The number of records is taken as (Σ v)² / Σ v²: one bright record among many is weak evidence.
    fn density(&self) -> Quadtree {
        let mut tree = self.tree.clone();
        if tree.is_empty() {
            return tree;
        }
        let mut shared = vec![0.0; tree.nodes.len()];
        shared[0] = 1.0;
        for at in 0..tree.nodes.len() {
            let node = &mut tree.nodes[at];
            let total = f64::from(node.total());
            let squares: f64 = self.squares[at].iter().sum();
            let prior = if total > 0.0 {
                PRIOR * squares / total
            } else {
                1.0
            };
            for quarter in 0..4 {
                let share = (f64::from(node.mass[quarter]) + prior) / (total + 4.0 * prior);
                node.mass[quarter] = shared[at] * share as f32;
                if node.child[quarter] != 0 {
                    shared[node.child[quarter] as usize] = node.mass[quarter];
                }
            }
        }
        tree
    }

    /// Empty sums whose leaves have no more than [`MAX_SHARE`] of the density each, within [`MAX_NODES`].
    fn refined(density: &Quadtree) -> Self {
        let mut fine = Self::default();
        let most = MAX_SHARE * density.nodes[0].total();
        // Masses of a node's quarters, its node in the density if there is one, its depth.
        let mut open = vec![(density.nodes[0].mass, Some(&density.nodes[0]), 1)];
        let mut at = 0;
        while let Some(&(mass, old, depth)) = open.get(at) {
            for (quarter, &mass) in mass.iter().enumerate() {
                let full = fine.tree.nodes.len() >= MAX_NODES || depth >= MAX_DEPTH;
                if full || mass <= most {
                    continue;
                }
                let below = old
                    .map(|old| old.child[quarter])
                    .filter(|child| *child != 0);
                let below = below.map(|child| &density.nodes[child as usize]);
                let masses = below.map_or([0.25 * mass; 4], |node| node.mass);
                fine.tree.nodes[at].child[quarter] = fine.tree.nodes.len() as u32;
                fine.tree.nodes.push(Node::default());
                fine.squares.push([0.0; 4]);
                open.push((masses, below, depth + 1));
            }
            at += 1;
        }
        fine
    }
}

#[cfg(test)]
mod tests;
