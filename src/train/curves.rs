//! Tabulated: for every pixel and factor, mean and second moment as curves over the factor.
//!
//! An event whose path does not fold depends on one effective factor γ, so the events of a pixel with the same factor
//! add up to one curve, sampled at [`NODES`] values of ln γ with exact derivatives and interpolated by cubic Hermite
//! polynomials. Left out: products of two events of different factors on one path. Paths that fold couple several
//! factors; they are kept as events and linearised anew whenever the table has moved (see [`Folded`]).

use super::folded::Folded;
use super::moments::{Adjoint, Moments, Source, no_gradient};
use super::recording::{Pixel, Recording};
use crate::math::real::Dual;
use crate::regularise::{AttenuationTable, GammaIndex, accumulate_at};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Values of γ at which curves are sampled, evenly in ln γ.
pub const NODES: usize = 17;

/// The smallest factor that is learned: at exactly 0 a Dirac lobe stays one, and the gradient is gone for ever.
pub const GAMMA_MIN: f32 = 1e-3;

/// Mean per channel and second moment, then their derivatives by ln γ in units of the nodes' distance.
type Knot = [f32; 8];

/// The curves of the pixels that depend on one effective factor.
struct Bundle {
    /// The table entries that make the factor, and their weights.
    entries: Vec<(GammaIndex, f32)>,
    pixels: Vec<u32>,
    /// Node by node, pixel by pixel.
    knots: Vec<Knot>,
    /// Derivative by γ of every pixel's curve at the factor last asked for.
    slopes: Vec<[f32; 4]>,
}

/// The curves of a crop.
pub struct Curves {
    constant: Moments,
    bundles: Vec<Bundle>,
    folded: Folded,
}

/// Distance of the nodes in ln γ.
fn spacing() -> f64 {
    -f64::from(GAMMA_MIN).ln() / (NODES - 1) as f64
}

/// γ of a node.
fn node(k: usize) -> f64 {
    (f64::from(GAMMA_MIN).ln() + k as f64 * spacing()).exp()
}

/// α′ of a code at every node, as a function of ln γ.
fn alphas(list: &[f32]) -> [Dual; NODES] {
    std::array::from_fn(|k| {
        let gamma = node(k);
        let (alpha, d) = accumulate_at(list, gamma as f32);
        Dual {
            v: alpha.into(),
            d: f64::from(d) * gamma * spacing(),
        }
    })
}

impl Curves {
    /// Bakes a recording. `table` says which look-up makes the factors; its values only matter where paths fold.
    pub fn bake(recording: &Recording, table: &AttenuationTable) -> Self {
        let codes = &recording.codes;
        // Codes that share their entries share their curves.
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
        let alphas: Vec<[Dual; NODES]> = (0..codes.len() as u32)
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
        Self {
            constant,
            bundles: bundle(entries, &baked),
            folded: Folded::new(recording),
        }
    }
}

/// The curves of one pixel, by group.
fn bake_pixel(
    recording: &Recording,
    pixel: &Pixel,
    group: &[Option<usize>],
    alphas: &[[Dual; NODES]],
) -> Vec<(usize, [Knot; NODES])> {
    let mut sums: BTreeMap<usize, Box<[[f64; 8]; NODES]>> = BTreeMap::new();
    for path in &pixel.paths {
        let events = &recording.events[path.first as usize..][..path.count as usize];
        for (i, event) in events.iter().enumerate() {
            let Some(g) = group[event.code as usize] else {
                continue;
            };
            let same = |e: &super::event::StoredEvent| group[e.code as usize] == Some(g);
            if events[..i].iter().any(same) {
                continue;
            }
            let sum = sums.entry(g).or_insert_with(|| Box::new([[0.0; 8]; NODES]));
            for (k, knot) in sum.iter_mut().enumerate() {
                let mut running = path.constant.map(|c| Dual {
                    v: c.into(),
                    d: 0.0,
                });
                for event in events[i..].iter().filter(|e| same(e)) {
                    let moment = event.at(alphas[event.code as usize][k]);
                    knot[3] += moment.y.v;
                    knot[7] += moment.y.d;
                    for c in 0..3 {
                        let cross = running[c] * moment.x[c];
                        knot[c] += moment.x[c].v;
                        knot[4 + c] += moment.x[c].d;
                        knot[3] += 2.0 * cross.v;
                        knot[7] += 2.0 * cross.d;
                        running[c] = running[c] + moment.x[c];
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
) -> Vec<Bundle> {
    let mut members: Vec<Vec<(u32, &[Knot; NODES])>> = vec![Vec::new(); entries.len()];
    for (pixel, curves) in (0u32..).zip(baked) {
        for (g, knots) in curves {
            members[*g].push((pixel, knots));
        }
    }
    (entries.into_iter().zip(members))
        .filter(|(_, members)| !members.is_empty())
        .map(|(entries, members)| Bundle {
            entries,
            pixels: members.iter().map(|m| m.0).collect(),
            knots: (0..NODES)
                .flat_map(|k| members.iter().map(move |m| m.1[k]))
                .collect(),
            slopes: vec![[0.0; 4]; members.len()],
        })
        .collect()
}

/// The interval of nodes that a factor is in, and where in it, from 0 to 1.
fn place(gamma: f64) -> (usize, f64) {
    let t = ((gamma / f64::from(GAMMA_MIN)).ln() / spacing()).clamp(0.0, (NODES - 1) as f64);
    let k = (t as usize).min(NODES - 2);
    (k, t - k as f64)
}

/// Cubic Hermite basis: value and slope on the left, value and slope on the right.
fn basis(t: f64) -> [f32; 4] {
    [
        (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t),
        t * (1.0 - t) * (1.0 - t),
        t * t * (3.0 - 2.0 * t),
        t * t * (t - 1.0),
    ]
    .map(|w| w as f32)
}

impl Bundle {
    fn factor(&self, table: &AttenuationTable) -> f32 {
        let raw: f32 = (self.entries.iter())
            .map(|&(class, weight)| weight * table.gammas[class.index()])
            .sum();
        (raw * table.scale).clamp(GAMMA_MIN, 1.0)
    }

    /// Adds the curves' values at the table's factor to the moments.
    fn add(&self, table: &AttenuationTable, moments: &mut Moments) {
        let (k, t) = place(self.factor(table).into());
        let value = basis(t);
        let n = self.pixels.len();
        let (low, high) = (&self.knots[k * n..][..n], &self.knots[(k + 1) * n..][..n]);
        for ((&pixel, a), b) in self.pixels.iter().zip(low).zip(high) {
            let v = [0, 1, 2, 3].map(|c| {
                value[0] * a[c] + value[1] * a[4 + c] + value[2] * b[c] + value[3] * b[4 + c]
            });
            let mean = &mut moments.mean[pixel as usize];
            for c in 0..3 {
                mean[c] += v[c];
            }
            moments.second[pixel as usize] += v[3];
        }
    }

    /// The same, and keeps the curves' slopes.
    fn add_with_slopes(&mut self, table: &AttenuationTable, moments: &mut Moments) {
        let gamma = f64::from(self.factor(table));
        let (k, t) = place(gamma);
        let value = basis(t);
        let per_gamma = 1.0 / (gamma * spacing());
        let slope = [
            6.0 * t * (t - 1.0),
            (1.0 - t) * (1.0 - 3.0 * t),
            6.0 * t * (1.0 - t),
            t * (3.0 * t - 2.0),
        ]
        .map(|w| (w * per_gamma) as f32);
        let n = self.pixels.len();
        let (low, high) = (&self.knots[k * n..][..n], &self.knots[(k + 1) * n..][..n]);
        for (((&pixel, out), a), b) in self.pixels.iter().zip(&mut self.slopes).zip(low).zip(high) {
            let mut v = [0.0f32; 4];
            for c in 0..4 {
                let knots = [a[c], a[4 + c], b[c], b[4 + c]];
                let dot = |w: [f32; 4]| {
                    w[0] * knots[0] + w[1] * knots[1] + w[2] * knots[2] + w[3] * knots[3]
                };
                v[c] = dot(value);
                out[c] = dot(slope);
            }
            let mean = &mut moments.mean[pixel as usize];
            for c in 0..3 {
                mean[c] += v[c];
            }
            moments.second[pixel as usize] += v[3];
        }
    }
}

impl Source for Curves {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        let mut moments = self.constant.clone();
        for bundle in &mut self.bundles {
            bundle.add_with_slopes(table, &mut moments);
        }
        self.folded.add(table, &mut moments);
        moments
    }

    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        let mut moments = self.constant.clone();
        for bundle in &self.bundles {
            bundle.add(table, &mut moments);
        }
        self.folded.add_exact(table, &mut moments);
        moments
    }

    fn movement(&self, table: &AttenuationTable) -> (f64, f64) {
        self.folded.movement(table)
    }

    fn anchor(&mut self, table: &AttenuationTable) {
        self.folded.anchor(table);
    }

    fn gradient(&self, _: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let mut gradient = no_gradient();
        for bundle in &self.bundles {
            let mut sum = 0.0f64;
            for (&pixel, slope) in bundle.pixels.iter().zip(&bundle.slopes) {
                let mean = adjoint.mean[pixel as usize];
                let d = mean[0] * slope[0]
                    + mean[1] * slope[1]
                    + mean[2] * slope[2]
                    + adjoint.second[pixel as usize] * slope[3];
                sum += f64::from(d);
            }
            for &(class, weight) in &bundle.entries {
                gradient[class.index()] += sum * f64::from(weight);
            }
        }
        self.folded.gradient(adjoint, &mut gradient);
        gradient
    }

    fn bytes(&self) -> usize {
        let knots: usize = self.bundles.iter().map(|b| b.knots.len()).sum();
        knots * size_of::<Knot>() + self.folded.bytes()
    }
}
