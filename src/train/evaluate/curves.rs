//! Tabulated: for every pixel and factor, mean and second moment as curves over the factor.
//!
//! An event whose path does not fold depends on one effective factor γ, so the events of a pixel with the same factor
//! add up to one curve, sampled at [`NODES`] values of ln γ with exact derivatives and interpolated by cubic Hermite
//! polynomials. Left out: products of two events of different factors on one path. Paths that fold couple several
//! factors; they are kept as events and linearised anew whenever the table has moved (see [`Folded`]).

use crate::math::real::{Dual, Real};
use crate::regularise::{AttenuationTable, GammaIndex, accumulate_at};
use crate::train::evaluate::folded::Folded;
use crate::train::evaluate::grid::{GAMMA_MIN, GridStep, HermiteWeights, NODES, node, spacing};
use crate::train::evaluate::moments::{Adjoint, MomentSource, Moments, no_gradient};
use crate::train::evaluate::sums::{ExactSums, Jacobian, add, rows};
use crate::train::record::event::{MeanAndSquare, PathSum};
use crate::train::record::recording::{RecordedPixel, Recording};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Mean per channel and second moment, then their derivatives by ln γ in units of the nodes' distance.
type Knot = [f32; 8];

/// The curves of the pixels that depend on one effective factor.
struct FactorCurves {
    /// The table entries that make the factor, and their weights.
    entries: Vec<(GammaIndex, f32)>,
    /// Node by node, pixel by pixel.
    knots: Vec<Knot>,
    /// The level next to where the factor was when the moments were last asked for.
    level: Option<GridStep>,
    /// Its pixels among those of all bundles.
    range: Range<usize>,
}

/// The curves of a crop.
pub struct Curves {
    constant: Moments,
    bundles: Vec<FactorCurves>,
    /// Derivative by γ of every pixel's curve at the level of its bundle, bundle by bundle.
    slopes: Jacobian,
    /// Of all bundles at their levels.
    sums: ExactSums,
    folded: Folded,
}

/// α′ of a code at every node, as a function of ln γ.
fn alphas(list: &[f32]) -> [Dual<f32>; NODES] {
    std::array::from_fn(|k| {
        let gamma = node(k);
        let (alpha, d) = accumulate_at(list, gamma as f32);
        Dual {
            v: alpha,
            d: (f64::from(d) * gamma * spacing()) as f32,
        }
    })
}

impl Curves {
    /// Bakes a recording. `table` says which look-up makes the factors; its values only matter where paths fold.
    pub fn bake(recording: &Recording, table: &AttenuationTable) -> Self {
        let codes = &recording.codes;
        // RoughnessLists that share their entries share their curves.
        let mut groups: BTreeMap<Vec<(usize, u32)>, usize> = BTreeMap::new();
        let mut entries = Vec::new();
        let group: Vec<Option<usize>> = (0..codes.len() as u32)
            .map(|code| {
                if codes.is_long(code) {
                    return None;
                }
                let list = codes.entries(code, table);
                let key = list
                    .iter()
                    .map(|&(c, w)| (c.index(), w.to_bits()))
                    .collect();
                Some(*groups.entry(key).or_insert_with(|| {
                    entries.push(list);
                    entries.len() - 1
                }))
            })
            .collect();
        let alphas: Vec<[Dual<f32>; NODES]> = (0..codes.len() as u32)
            .into_par_iter()
            .map(|code| match codes.is_long(code) {
                true => [Dual::default(); NODES],
                false => alphas(codes.list(code)),
            })
            .collect();
        let baked: Vec<Vec<(usize, [Knot; NODES])>> = (recording.pixels.par_iter())
            .map(|pixel| bake_pixel(recording, pixel, &group, &alphas))
            .collect();
        let constant = Moments {
            mean: (recording.pixels.iter())
                .map(|p| p.constant.map(|c| (c / f64::from(p.samples.max(1))) as f32))
                .collect(),
            second: (recording.pixels.iter())
                .map(|p| (p.constant_squared / f64::from(p.samples.max(1))) as f32)
                .collect(),
        };
        let (bundles, slopes) = bundle(entries, &baked);
        Self {
            constant,
            bundles,
            slopes,
            sums: ExactSums::new(baked.len(), bound(&baked)),
            folded: Folded::new(recording),
        }
    }
}

/// The curves of one pixel, by group.
fn bake_pixel(
    recording: &Recording,
    pixel: &RecordedPixel,
    group: &[Option<usize>],
    alphas: &[[Dual<f32>; NODES]],
) -> Vec<(usize, [Knot; NODES])> {
    let mut sums: BTreeMap<usize, Box<[[f64; 8]; NODES]>> = BTreeMap::new();
    for path in &pixel.paths {
        let events = &recording.events[path.first as usize..][..path.count as usize];
        for (i, event) in events.iter().enumerate() {
            let Some(g) = group[event.code as usize] else {
                continue;
            };
            let same =
                |e: &crate::train::record::event::StoredEvent| group[e.code as usize] == Some(g);
            if events[..i].iter().any(same) {
                continue;
            }
            let sum = sums.entry(g).or_insert_with(|| Box::new([[0.0; 8]; NODES]));
            for (k, knot) in sum.iter_mut().enumerate() {
                let mut running = PathSum::new(path.constant.map(Dual::constant));
                for event in events[i..].iter().filter(|e| same(e)) {
                    let MeanAndSquare { x, mut y } = event.tangent(alphas[event.code as usize][k]);
                    let met = running.meet(event, x);
                    for c in 0..3 {
                        let cross = met[c] * x[c];
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

/// Turns curves by pixel into curves by group.
fn bundle(
    entries: Vec<Vec<(GammaIndex, f32)>>,
    baked: &[Vec<(usize, [Knot; NODES])>],
) -> (Vec<FactorCurves>, Jacobian) {
    let mut members: Vec<Vec<(u32, &[Knot; NODES])>> = vec![Vec::new(); entries.len()];
    for (pixel, curves) in (0u32..).zip(baked) {
        for (g, knots) in curves {
            members[*g].push((pixel, knots));
        }
    }
    let mut slopes = Jacobian::default();
    let bundles = (entries.into_iter().zip(members))
        .filter(|(_, members)| !members.is_empty())
        .map(|(entries, members)| {
            let start = slopes.len();
            for (pixel, _) in &members {
                slopes.push(*pixel);
            }
            FactorCurves {
                entries,
                knots: (0..NODES)
                    .flat_map(|k| members.iter().map(move |m| m.1[k]))
                    .collect(),
                level: None,
                range: start..slopes.len(),
            }
        })
        .collect();
    (bundles, slopes)
}

/// What the curves of no pixel add up to more than.
fn bound(baked: &[Vec<(usize, [Knot; NODES])>]) -> [f64; 4] {
    let mut bound = [0.0f64; 4];
    for curves in baked {
        for (c, b) in bound.iter_mut().enumerate() {
            // The basis of the slopes is at most 4/27.
            let highest = |knots: &[Knot; NODES]| -> f64 {
                let of = knots.iter().map(|k| f64::from(k[c].abs() + k[4 + c].abs()));
                of.filter(|v| v.is_finite()).fold(0.0, f64::max)
            };
            *b = b.max(curves.iter().map(|(_, knots)| highest(knots)).sum());
        }
    }
    bound
}

/// A curve's value or slope.
#[inline]
fn read(low: &Knot, high: &Knot, weights: [f32; 4]) -> [f32; 4] {
    let [a, da, b, db] = weights;
    let mut sum = [0.0; 4];
    for c in 0..4 {
        sum[c] = a * low[c] + da * low[4 + c] + b * high[c] + db * high[4 + c];
    }
    sum
}

impl FactorCurves {
    fn factor(&self, table: &AttenuationTable) -> f32 {
        let raw: f32 = (self.entries.iter())
            .map(|&(class, weight)| weight * table.gammas[class.index()])
            .sum();
        (raw * table.scale).clamp(GAMMA_MIN, 1.0)
    }

    /// The knots on both sides of a place, pixel by pixel.
    fn knots(&self, place: &HermiteWeights) -> (&[Knot], &[Knot]) {
        let n = self.range.len();
        let at = |k: usize| &self.knots[k * n..][..n];
        (at(place.node), at(place.node + 1))
    }

    /// Adds the curves' values at the table's factor to the moments.
    fn add(&self, table: &AttenuationTable, slopes: &Jacobian, moments: &mut Moments) {
        let place = HermiteWeights::of(self.factor(table).into());
        let (low, high) = self.knots(&place);
        for ((&pixel, a), b) in slopes.pixels(self.range.clone()).iter().zip(low).zip(high) {
            let v = read(a, b, place.value);
            let mean = &mut moments.mean[pixel as usize];
            for c in 0..3 {
                mean[c] += v[c];
            }
            moments.second[pixel as usize] += v[3];
        }
    }

    /// Goes to the level next to the table's factor: the curves' values into the sums, and their slopes.
    fn step(&mut self, level: GridStep, slopes: &mut Jacobian, sums: &mut ExactSums) {
        let before = self.level.replace(level).map(GridStep::place);
        let place = level.place();
        let (low, high) = self.knots(&place);
        let old = before.map(|b| (b.value, self.knots(&b)));
        slopes.update(self.range.clone(), |i, pixel| {
            let old = old.map_or([0.0; 4], |(w, (low, high))| read(&low[i], &high[i], w));
            sums.exchange(pixel, old, read(&low[i], &high[i], place.value));
            read(&low[i], &high[i], place.slope)
        });
    }
}

impl MomentSource for Curves {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        for bundle in &mut self.bundles {
            let level = GridStep::of(bundle.factor(table));
            if bundle.level != Some(level) {
                bundle.step(level, &mut self.slopes, &mut self.sums);
            }
        }
        let mut rows = self.sums.rows();
        for bundle in &self.bundles {
            let from = bundle.level.map_or(0.0, GridStep::gamma);
            let by = bundle.factor(table) - from;
            self.slopes.follow(bundle.range.clone(), by, &mut rows);
        }
        self.folded.follow(table, &mut rows);
        let mut moments = self.constant.clone();
        add(&rows, &mut moments);
        moments
    }

    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        let mut moments = self.constant.clone();
        for bundle in &self.bundles {
            bundle.add(table, &self.slopes, &mut moments);
        }
        self.folded.add_exact(table, &mut moments);
        moments
    }

    fn add_weights(&self, weights: &mut [f64]) {
        self.folded.add_weights(weights);
    }

    fn work(&self) -> usize {
        self.slopes.len() + self.folded.work()
    }

    fn anchor(&mut self, table: &AttenuationTable) {
        self.folded.anchor(table);
    }

    fn gradient(&self, _: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let mut gradient = no_gradient();
        let adjoint = rows(adjoint);
        for bundle in &self.bundles {
            let d = self.slopes.gradient(bundle.range.clone(), &adjoint);
            for &(class, weight) in &bundle.entries {
                gradient[class.index()] += d * f64::from(weight);
            }
        }
        self.folded.gradient(&adjoint, &mut gradient);
        gradient
    }

    fn bytes(&self) -> usize {
        let knots: usize = self.bundles.iter().map(|b| b.knots.len()).sum();
        knots * size_of::<Knot>() + self.folded.bytes()
    }
}
