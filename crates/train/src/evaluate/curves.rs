//! Tabulated: mean and second moment of every pixel as curves over the factor.
//!
//! An event on a path that does not fold depends on one effective factor γ, so the events of a pixel with the same
//! factor add up to one curve. It is sampled at 17 values of ln γ with exact derivatives, and interpolated by
//! cubic Hermite polynomials. Neglected: products of two events of different factors on one path. Paths that fold
//! couple several factors; their events are linearised anew whenever the table has moved far (`folded.rs`).

use crate::derivative::accumulate_at;
use crate::evaluate::folded::Folded;
use crate::evaluate::jacobian::{ExactSums, Jacobian, PixelMoments, add, by_pixel};
use crate::evaluate::{Adjoint, GAMMA_MIN, MomentSource, Moments, no_gradient};
use crate::record::event::{PathSum, StoredEvent};
use crate::record::recording::{RecordedPixel, Recording};
use half::f16;
use half::slice::HalfFloatSliceExt;
use opsr::math::real::{Dual, Real};
use opsr::regularise::{AttenuationTable, GammaIndex};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Number of values of γ at which curves are sampled, evenly spaced in ln γ from [`GAMMA_MIN`] to 1.
const NODES: usize = 17;

/// Grid steps between two nodes, each 5.5 % in γ. A tangent over half a step has an error of at most 0.08 % for a curve
/// proportional to γ².
const STEPS_PER_NODE: u32 = 8;

/// Distance of two nodes in ln γ.
fn spacing() -> f64 {
    -f64::from(GAMMA_MIN).ln() / (NODES - 1) as f64
}

/// γ of a node.
fn node(k: usize) -> f64 {
    (f64::from(GAMMA_MIN).ln() + k as f64 * spacing()).exp()
}

/// Coordinate of a factor among the nodes, from 0 to NODES − 1.
fn coordinate(gamma: f64) -> f64 {
    ((gamma / f64::from(GAMMA_MIN)).ln() / spacing()).clamp(0.0, (NODES - 1) as f64)
}

/// Cubic Hermite interpolation at one γ: weights of value and derivative at the left node, then at the right one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HermiteWeights {
    /// The left node.
    node: usize,
    /// Weights that give the curve's value.
    value: [f32; 4],
    /// Weights that give its derivative by γ.
    derivative: [f32; 4],
}

impl HermiteWeights {
    fn at(coordinate: f64) -> Self {
        let node = (coordinate as usize).min(NODES - 2);
        let t = coordinate - node as f64;
        let per_gamma = 1.0 / (f64::from(GAMMA_MIN) * (coordinate * spacing()).exp() * spacing());
        let value = [
            (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t),
            t * (1.0 - t) * (1.0 - t),
            t * t * (3.0 - 2.0 * t),
            t * t * (t - 1.0),
        ];
        let derivative = [
            6.0 * t * (t - 1.0),
            (1.0 - t) * (1.0 - 3.0 * t),
            6.0 * t * (1.0 - t),
            t * (3.0 * t - 2.0),
        ];
        Self {
            node,
            value: value.map(|w| w as f32),
            derivative: derivative.map(|w| (w * per_gamma) as f32),
        }
    }
}

/// One of the values of γ at which curves are linearised.
///
/// A step of Adam moves a factor by little, so its curves are evaluated again only when the factor reaches another grid
/// step. The tangent depends on the grid step alone, not on earlier factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct GridStep(u32);

impl GridStep {
    fn nearest(gamma: f32) -> Self {
        Self((coordinate(gamma.into()) * f64::from(STEPS_PER_NODE)).round() as u32)
    }

    fn coordinate(self) -> f64 {
        f64::from(self.0) / f64::from(STEPS_PER_NODE)
    }

    fn gamma(self) -> f32 {
        (f64::from(GAMMA_MIN) * (self.coordinate() * spacing()).exp()) as f32
    }

    fn weights(self) -> HermiteWeights {
        HermiteWeights::at(self.coordinate())
    }
}

/// Mean per channel and second moment at a node, then their derivatives by the coordinate.
type Knot = [f32; 8];

/// A knot divided by the scales of its curve, which are its largest values. Half precision takes half of the memory and
/// changes a curve by at most 0.03 % of its scales.
type StoredKnot = [f16; 8];

/// The curves of all pixels that depend on one effective factor.
struct FactorCurves {
    /// The table entries that make the factor, and their weights.
    entries: Vec<(GammaIndex, f32)>,
    /// Grid step of the tangent.
    step: Option<GridStep>,
    /// Range of its pixels in the Jacobian.
    range: Range<usize>,
}

/// The knots of all curves.
struct Knots {
    /// Knots ordered by factor, then node, then pixel.
    stored: Vec<StoredKnot>,
    /// Scale of mean per channel and second moment, curve by curve as in the Jacobian.
    scales: Vec<PixelMoments>,
}

/// The curves of a crop.
pub struct Curves {
    /// Moments of the parts of all paths that do not depend on the table.
    constant: Moments,
    factors: Vec<FactorCurves>,
    knots: Knots,
    /// Derivatives by γ at the grid step of each factor.
    jacobian: Jacobian,
    /// Values of all curves at the grid step of their factor.
    sums: ExactSums,
    folded: Folded,
}

/// Curves of one pixel: the index of each effective factor, and its knots.
type PixelCurves = Vec<(usize, [Knot; NODES])>;

impl Curves {
    /// Tabulates a recording. The curves depend on the look-up of `table`, not on its factors.
    pub fn bake(recording: &Recording, table: &AttenuationTable) -> Self {
        let lists = &recording.lists;
        // Lists with the same entries share their curves.
        let mut groups: BTreeMap<Vec<(usize, u32)>, usize> = BTreeMap::new();
        let mut entries = Vec::new();
        let group: Vec<Option<usize>> = lists
            .codes()
            .map(|code| {
                if lists.is_long(code) {
                    return None;
                }
                let of_list = lists.entries(code, table);
                let key = (of_list.iter().map(|&(c, w)| (c.index(), w.to_bits()))).collect();
                Some(*groups.entry(key).or_insert_with(|| {
                    entries.push(of_list);
                    entries.len() - 1
                }))
            })
            .collect();
        let alphas: Vec<[Dual<f32>; NODES]> = lists
            .codes()
            .into_par_iter()
            .map(|code| match lists.is_long(code) {
                true => [Dual::default(); NODES],
                false => node_alphas(lists.list(code)),
            })
            .collect();
        let baked: Vec<PixelCurves> = recording
            .pixels
            .par_iter()
            .map(|pixel| bake_pixel(recording, pixel, &group, &alphas))
            .collect();
        let samples = |p: &RecordedPixel| f64::from(p.samples.max(1));
        let constant = Moments {
            mean: recording
                .pixels
                .iter()
                .map(|p| p.constant.map(|c| (c / samples(p)) as f32))
                .collect(),
            second: recording
                .pixels
                .iter()
                .map(|p| (p.constant_squared / samples(p)) as f32)
                .collect(),
        };
        let (factors, knots, jacobian) = by_factor(entries, &baked);
        Self {
            constant,
            factors,
            knots,
            jacobian,
            sums: ExactSums::new(baked.len(), bound(&baked)),
            folded: Folded::new(recording),
        }
    }
}

/// α′ of a list at every node, with its derivative by the coordinate.
fn node_alphas(list: &[f32]) -> [Dual<f32>; NODES] {
    std::array::from_fn(|k| {
        let gamma = node(k);
        let (alpha, d) = accumulate_at(list, gamma as f32);
        Dual {
            v: alpha,
            d: (f64::from(d) * gamma * spacing()) as f32,
        }
    })
}

fn bake_pixel(
    recording: &Recording,
    pixel: &RecordedPixel,
    group: &[Option<usize>],
    alphas: &[[Dual<f32>; NODES]],
) -> PixelCurves {
    let mut sums: BTreeMap<usize, Box<[[f64; 8]; NODES]>> = BTreeMap::new();
    for path in &pixel.paths {
        let events = recording.events_of(path);
        for (i, event) in events.iter().enumerate() {
            let Some(g) = group[event.code as usize] else {
                continue;
            };
            let same = |e: &StoredEvent| group[e.code as usize] == Some(g);
            if events[..i].iter().any(same) {
                continue;
            }
            let sum = sums.entry(g).or_insert_with(|| Box::new([[0.0; 8]; NODES]));
            for (k, knot) in sum.iter_mut().enumerate() {
                let mut path_sum = PathSum::new(path.constant.map(Dual::constant));
                for event in events[i..].iter().filter(|e| same(e)) {
                    let at_node = event.tangent(alphas[event.code as usize][k]);
                    let (x, mut y) = (at_node.mean, at_node.square);
                    let before = path_sum.add(event, x);
                    for c in 0..3 {
                        let cross = before[c] * x[c];
                        y = y + cross + cross;
                    }
                    for (c, part) in [x[0], x[1], x[2], y].into_iter().enumerate() {
                        knot[c] += f64::from(part.v);
                        knot[4 + c] += f64::from(part.d);
                    }
                }
            }
        }
    }
    let n = f64::from(pixel.samples.max(1));
    sums.into_iter()
        .map(|(g, sum)| (g, sum.map(|knot| knot.map(|v| (v / n) as f32))))
        .collect()
}

/// Reorders the curves of all pixels by factor, and allocates their Jacobian with zero derivatives.
fn by_factor(
    entries: Vec<Vec<(GammaIndex, f32)>>,
    baked: &[PixelCurves],
) -> (Vec<FactorCurves>, Knots, Jacobian) {
    let mut members: Vec<Vec<(u32, &[Knot; NODES])>> = vec![Vec::new(); entries.len()];
    for (pixel, curves) in (0u32..).zip(baked) {
        for (g, knots) in curves {
            members[*g].push((pixel, knots));
        }
    }
    // Exact capacities, since a vector that grows by doubling takes up to twice the memory.
    let curves = baked.iter().map(Vec::len).sum();
    let mut knots = Knots {
        stored: Vec::with_capacity(NODES * curves),
        scales: Vec::with_capacity(curves),
    };
    let mut jacobian = Jacobian::with_capacity(curves);
    let factors = entries
        .into_iter()
        .zip(members)
        .filter(|(_, members)| !members.is_empty())
        .map(|(entries, members)| {
            let start = jacobian.len();
            for (pixel, of_pixel) in &members {
                jacobian.push(*pixel);
                knots.scales.push(scales(of_pixel));
            }
            for k in 0..NODES {
                let of_node = members.iter().zip(&knots.scales[start..]);
                let of_node = of_node.map(|((_, of_pixel), scales)| store(&of_pixel[k], scales));
                knots.stored.extend(of_node);
            }
            FactorCurves {
                entries,
                step: None,
                range: start..jacobian.len(),
            }
        })
        .collect();
    (factors, knots, jacobian)
}

/// Upper bound, over all factors, of the sum of a pixel's curves.
fn bound(baked: &[PixelCurves]) -> [f64; 4] {
    let mut bound = [0.0f64; 4];
    for curves in baked {
        for (c, b) in bound.iter_mut().enumerate() {
            // A knot bounds its curve by |value| + |derivative|: the Hermite basis of the derivatives is at most 4/27.
            let highest = |knots: &[Knot; NODES]| -> f64 {
                let of = knots.iter().map(|k| f64::from(k[c].abs() + k[4 + c].abs()));
                of.filter(|v| v.is_finite()).fold(0.0, f64::max)
            };
            *b = b.max(curves.iter().map(|(_, knots)| highest(knots)).sum());
        }
    }
    bound
}

/// Scales of a curve: the largest finite absolute values of its knots, or 1 if all are 0.
fn scales(knots: &[Knot; NODES]) -> PixelMoments {
    std::array::from_fn(|c| {
        let sizes = knots.iter().flat_map(|k| [k[c].abs(), k[4 + c].abs()]);
        let largest = sizes.filter(|size| size.is_finite()).fold(0.0, f32::max);
        if largest > 0.0 { largest } else { 1.0 }
    })
}

fn store(knot: &Knot, scales: &PixelMoments) -> StoredKnot {
    std::array::from_fn(|c| f16::from_f32(knot[c] / scales[c % 4]))
}

/// Value or derivative of a curve between two knots.
#[inline]
fn interpolate(
    left: &StoredKnot,
    right: &StoredKnot,
    scales: &PixelMoments,
    weights: [f32; 4],
) -> PixelMoments {
    let [a, da, b, db] = weights;
    let (mut l, mut r) = ([0.0; 8], [0.0; 8]);
    left.convert_to_f32_slice(&mut l);
    right.convert_to_f32_slice(&mut r);
    std::array::from_fn(|c| (a * l[c] + da * l[4 + c] + b * r[c] + db * r[4 + c]) * scales[c])
}

impl Knots {
    fn bytes(&self) -> usize {
        size_of_val(self.stored.as_slice()) + size_of_val(self.scales.as_slice())
    }
}

impl FactorCurves {
    /// The effective factor at a table, from [`GAMMA_MIN`] to 1.
    fn gamma(&self, table: &AttenuationTable) -> f32 {
        let raw: f32 = self
            .entries
            .iter()
            .map(|&(class, weight)| weight * table.gammas[class.index()])
            .sum();
        (raw * table.scale).clamp(GAMMA_MIN, 1.0)
    }

    /// Interpolates the curves of this factor, each by its index in the range.
    fn interpolator<'a>(
        &self,
        knots: &'a Knots,
        weights: &HermiteWeights,
    ) -> impl Fn(usize, [f32; 4]) -> PixelMoments + use<'a> {
        let n = self.range.len();
        let at = |k: usize| &knots.stored[NODES * self.range.start + k * n..][..n];
        let (left, right) = (at(weights.node), at(weights.node + 1));
        let scales = &knots.scales[self.range.clone()];
        move |i, weights| interpolate(&left[i], &right[i], &scales[i], weights)
    }

    /// Adds the curves' values at the table's factor to the moments.
    fn add_exact(
        &self,
        table: &AttenuationTable,
        knots: &Knots,
        jacobian: &Jacobian,
        moments: &mut Moments,
    ) {
        let weights = HermiteWeights::at(coordinate(self.gamma(table).into()));
        let curve = self.interpolator(knots, &weights);
        for (i, &pixel) in jacobian.pixels(self.range.clone()).iter().enumerate() {
            let v = curve(i, weights.value);
            let mean = &mut moments.mean[pixel as usize];
            for c in 0..3 {
                mean[c] += v[c];
            }
            moments.second[pixel as usize] += v[3];
        }
    }

    /// Moves the tangent to a grid step: values in `sums`, derivatives in the Jacobian.
    fn move_to(
        &mut self,
        step: GridStep,
        knots: &Knots,
        jacobian: &mut Jacobian,
        sums: &mut ExactSums,
    ) {
        let old = self.step.replace(step).map(GridStep::weights);
        let new = step.weights();
        let curve = self.interpolator(knots, &new);
        let old = old.map(|old| (old.value, self.interpolator(knots, &old)));
        jacobian.update(self.range.clone(), |i, pixel| {
            let before = old
                .as_ref()
                .map_or([0.0; 4], |(weights, curve)| curve(i, *weights));
            sums.exchange(pixel, before, curve(i, new.value));
            curve(i, new.derivative)
        });
    }
}

impl MomentSource for Curves {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        for factor in &mut self.factors {
            let step = GridStep::nearest(factor.gamma(table));
            if factor.step != Some(step) {
                factor.move_to(step, &self.knots, &mut self.jacobian, &mut self.sums);
            }
        }
        let mut pixels = self.sums.pixels();
        for factor in &self.factors {
            let from = factor.step.map_or(0.0, GridStep::gamma);
            let by = factor.gamma(table) - from;
            self.jacobian.follow(factor.range.clone(), by, &mut pixels);
        }
        self.folded.follow(table, &mut pixels);
        let mut moments = self.constant.clone();
        add(&pixels, &mut moments);
        moments
    }

    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        let mut moments = self.constant.clone();
        for factor in &self.factors {
            factor.add_exact(table, &self.knots, &self.jacobian, &mut moments);
        }
        self.folded.add_exact(table, &mut moments);
        moments
    }

    fn gradient(&self, _: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let mut gradient = no_gradient();
        let adjoint = by_pixel(adjoint);
        for factor in &self.factors {
            let d = self.jacobian.gradient(factor.range.clone(), &adjoint);
            for &(class, weight) in &factor.entries {
                gradient[class.index()] += d * f64::from(weight);
            }
        }
        self.folded.gradient(&adjoint, &mut gradient);
        gradient
    }

    fn anchor(&mut self, table: &AttenuationTable) {
        self.folded.anchor(table);
    }

    fn add_weights(&self, weights: &mut [f64]) {
        self.folded.add_weights(weights);
    }

    fn work(&self) -> usize {
        self.jacobian.len() + self.folded.work()
    }

    fn bytes(&self) -> usize {
        self.knots.bytes() + self.folded.bytes()
    }
}

#[cfg(test)]
mod tests;
