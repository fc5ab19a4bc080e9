//! The guide: a distribution of directions for every region of space.
//!
//! A binary tree halves the cube around the scene, axis by axis; each leaf has the quadtree that paths sample and one
//! that is being filled `[Müller17 §3.1]`. Within a leaf, records are added in a fixed order at any number of threads.

use super::quadtree::{MAX_TREE_BYTES, Quadtree, Sums, square};
use crate::math::{Vec2, Vec3};
use rayon::prelude::*;

/// Records above which a leaf is split after the first iteration; after iteration k (from 0) 2^(k/2) times as many
/// `[Müller17 §3.3]`. The 12000 of that paper are for pictures of more pixels.
const DIVIDED_ABOVE: f64 = 800.0;

/// Most leaves of the tree, which bounds its memory.
const MAX_LEAVES: usize = 8192;

/// Candidates for the probability of drawing from the BSDF. A leaf takes the one with the largest Σ w log p, with w the
/// light from a direction over its density: the mixture with the least Kullback-Leibler divergence from the light
/// found. `[Müller19 §3.3]` uses gradient descent. Path weights grow at most by a factor of 2 per vertex.
const SHARES: [f32; 5] = [0.5, 0.65, 0.8, 0.9, 1.0];

/// Least gain of the mean of log p over the BSDF alone for which directions are drawn from a tree.
const MIN_GAIN: f64 = 0.05;

/// One path's estimate of the radiance that arrives at a vertex from a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// Leaf of the vertex, or one beside it.
    pub(super) leaf: u32,
    /// The direction, mapped to the unit square.
    pub(super) at: Vec2,
    /// Luminance over the density of the direction.
    pub(super) value: f32,
    /// Luminance of the light that the BSDF scatters, over the same density.
    pub(super) scattered: f32,
    /// Densities of the direction in the BSDF and in the tree.
    pub(super) pdfs: [f32; 2],
    /// Class of the vertex, for the choice of a share.
    pub(super) class: u8,
}

/// A node of the tree of space.
#[derive(Clone, Copy, Debug, Default)]
struct Halves {
    /// Indices of the halves' nodes; 0 in a leaf.
    children: [u32; 2],
    /// Index of the leaf.
    leaf: u32,
}

/// Classes of vertices, with a share each: Lambertian surfaces, and others.
const CLASSES: usize = 2;

/// A region of space.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    /// The density that paths sample; empty before the first record.
    pub(super) tree: Quadtree,
    filling: Sums,
    /// Records of this iteration.
    count: u64,
    /// Probability of drawing from the BSDF, for each class of lobes.
    pub(super) shares: [f32; CLASSES],
    /// Σ w log p of each share.
    fits: [Fit; CLASSES],
}

/// Log-likelihoods of the candidates for a share.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    /// Σ w.
    weight: f64,
    /// Σ w log p of each share.
    logs: [f64; SHARES.len()],
}

impl Fit {
    /// The best share; that of the BSDF alone unless another is clearly better.
    fn best(&self) -> f32 {
        let alone = self.logs[SHARES.len() - 1] + MIN_GAIN * self.weight;
        let best = (SHARES.iter().zip(self.logs)).max_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, log)| *log > alone)
            .map_or(1.0, |(share, _)| *share)
    }
}

/// The guide of a scene, empty at first.
#[derive(Clone, Debug)]
pub(super) struct Field {
    /// Lowest corner of the cube, and one over its edge.
    low: Vec3,
    scale: f32,
    nodes: Vec<Halves>,
    leaves: Vec<Leaf>,
    /// Iterations that are complete.
    iterations: u32,
}

impl Leaf {
    fn new() -> Self {
        Self {
            tree: Quadtree::default(),
            filling: Sums::default(),
            count: 0,
            // No draws from a tree before its density fits the light of samples of the BSDF.
            shares: [1.0; CLASSES],
            fits: [Fit::default(); CLASSES],
        }
    }

    fn add(&mut self, record: &Record) {
        self.count += 1;
        if record.value > 0.0 {
            self.filling.add(record.at, record.value);
            let [bsdf, tree] = record.pdfs;
            if record.scattered > 0.0 && !self.tree.is_empty() {
                let fit = &mut self.fits[usize::from(record.class)];
                let weight = f64::from(record.scattered);
                fit.weight += weight;
                for (log, share) in fit.logs.iter_mut().zip(SHARES) {
                    let pdf = share * bsdf + (1.0 - share) * tree;
                    *log += weight * f64::from(pdf.ln());
                }
            }
        }
    }

    /// Ends an iteration: the density of the filled sums replaces the sampled one, unless it is empty.
    fn next(&mut self) {
        let density = self.filling.finish();
        if !density.is_empty() {
            self.tree = density;
        }
        for (share, fit) in self.shares.iter_mut().zip(&mut self.fits) {
            *share = fit.best();
            *fit = Fit::default();
        }
    }
}

impl Field {
    /// An empty guide for the box between two corners.
    pub(super) fn new((low, high): (Vec3, Vec3)) -> Self {
        let edge = (high - low).max_element();
        Self {
            low,
            scale: if edge > 0.0 { 1.0 / edge } else { 0.0 },
            nodes: vec![Halves::default()],
            leaves: vec![Leaf::new()],
            iterations: 0,
        }
    }

    /// Most bytes that a guide takes.
    pub(super) const MAX_BYTES: u64 = (MAX_LEAVES * (MAX_TREE_BYTES + size_of::<Leaf>())) as u64;

    /// The leaf of a position, and the edges of its box.
    #[inline]
    pub(super) fn leaf(&self, position: Vec3) -> (u32, Vec3) {
        let mut p = ((position - self.low) * self.scale).clamp(Vec3::ZERO, Vec3::ONE);
        let (mut node, mut axis, mut edges) = (&self.nodes[0], 0, Vec3::ONE);
        while node.children[0] != 0 {
            p[axis] *= 2.0;
            edges[axis] *= 0.5;
            let upper = p[axis] >= 1.0;
            if upper {
                p[axis] -= 1.0;
            }
            node = &self.nodes[node.children[usize::from(upper)] as usize];
            axis = (axis + 1) % 3;
        }
        (node.leaf, edges / self.scale)
    }

    /// A record's leaf and point of the square, for a position moved by `offset` and a direction moved by `turn` edges
    /// of its quadtree leaf, so that neighbours share records `[Müller19 §3.2]`. `turn` is in [-0.5, 0.5).
    pub(super) fn blurred(
        &self,
        position: Vec3,
        offset: Vec3,
        dir: Vec3,
        turn: Vec2,
    ) -> (u32, Vec2) {
        let leaf = self.leaf(position + offset).0;
        let p = square(dir);
        let edge = self.leaves[leaf as usize].filling.leaf_edge(p);
        let mut at = p + edge * turn;
        at.x = if at.x < 0.0 {
            -at.x
        } else {
            at.x.min(2.0 - at.x)
        };
        at.y -= at.y.floor();
        (leaf, at.clamp(Vec2::ZERO, Vec2::splat(1.0f32.next_down())))
    }

    /// The region of a leaf.
    #[inline]
    pub(super) fn region(&self, leaf: u32) -> &Leaf {
        &self.leaves[leaf as usize]
    }

    /// Adds records, in parallel over leaves.
    pub(super) fn add(&mut self, records: &[Record]) {
        let mut ends = vec![0u32; self.leaves.len() + 1];
        for record in records {
            ends[record.leaf as usize + 1] += 1;
        }
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let mut next = ends.clone();
        let mut order = vec![0u32; records.len()];
        for (i, record) in records.iter().enumerate() {
            let place = &mut next[record.leaf as usize];
            order[*place as usize] = i as u32;
            *place += 1;
        }
        self.leaves
            .par_iter_mut()
            .enumerate()
            .for_each(|(i, leaf)| {
                for &place in &order[ends[i] as usize..ends[i + 1] as usize] {
                    leaf.add(&records[place as usize]);
                }
            });
    }

    /// Ends an iteration: its records make the next distributions, and leaves of many records are split.
    pub(super) fn next(&mut self) {
        self.leaves.par_iter_mut().for_each(Leaf::next);
        let most = DIVIDED_ABOVE * 2f64.powf(0.5 * f64::from(self.iterations));
        let mut at = 0;
        // Nodes that are appended are visited too.
        while at < self.nodes.len() {
            let Halves { children, leaf } = self.nodes[at];
            if children[0] == 0
                && self.leaves[leaf as usize].count as f64 > most
                && self.leaves.len() < MAX_LEAVES
            {
                let region = &mut self.leaves[leaf as usize];
                region.count /= 2;
                let half = region.clone();
                let (first, second) = (self.nodes.len() as u32, self.leaves.len() as u32);
                self.leaves.push(half);
                self.nodes[at].children = [first, first + 1];
                self.nodes.extend([leaf, second].map(|leaf| Halves {
                    children: [0; 2],
                    leaf,
                }));
            }
            at += 1;
        }
        self.leaves.iter_mut().for_each(|leaf| leaf.count = 0);
        self.iterations += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guide_divides_space_where_records_are() {
        let mut field = Field::new((Vec3::ZERO, Vec3::new(4.0, 1.0, 2.0)));
        let corner = Vec3::new(0.1, 0.1, 0.1);
        for _ in 0..6 {
            let at = |i: i32| corner + 0.05 * Vec3::splat(i as f32 / 4000.0);
            let records: Vec<Record> = (0..4000)
                .map(|i| Record {
                    leaf: field.leaf(at(i)).0,
                    at: Vec2::splat(0.3),
                    value: 1.0,
                    scattered: 1.0,
                    pdfs: [0.1, 0.1],
                    class: 0,
                })
                .collect();
            field.add(&records);
            field.next();
        }
        let edge = |p| field.leaf(p).1.max_element();
        assert!(edge(corner) < 0.6, "{}", edge(corner));
        assert!(edge(Vec3::new(3.9, 0.9, 1.9)) >= 2.0);
        // Both halves of a split leaf start with its density.
        let region = |p| field.region(field.leaf(p).0);
        assert!(!region(Vec3::new(3.9, 0.9, 1.9)).tree.is_empty());
        assert!(
            region(corner)
                .tree
                .pdf(super::super::quadtree::direction(Vec2::splat(0.3)))
                > 1.0
        );
    }
}
