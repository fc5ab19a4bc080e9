//! Events of paths of more than five vertices, whose roughness folds: each depends on the factors of several classes.
//!
//! They are evaluated exactly, with derivatives, at one table, the anchor, and followed by the tangent from there until
//! the factors have moved too far.

use crate::math::real::{Dual, Real};
use crate::regularise::{AttenuationTable, GammaIndex, LEN};
use crate::train::evaluate::moments::Moments;
use crate::train::evaluate::sums::{Jacobian, PixelMoments};
use crate::train::record::event::{MeanAndSquare, StoredEvent};
use crate::train::record::lists::{PrefetchBuffer, RoughnessLists};
use crate::train::record::recording::Recording;
use rayon::prelude::*;
use std::ops::Range;

/// A slope that is smaller than this times the mean of its class is left out. On the crops with the most folded paths,
/// 12 to 35 % of all slopes are below a hundredth of it, with 0.04 % of their sum, and 35 to 53 % below a tenth, with 0.9 %.
const FAINT: f64 = 0.03;

/// An event, what else its path carries, and the share of a sample in its pixel's mean.
struct FoldedEvent {
    constant: [f32; 3],
    event: StoredEvent,
}

/// The folded events of a crop.
#[derive(Default)]
pub(in crate::train) struct Folded {
    /// Those of the events, all of them long.
    codes: RoughnessLists,
    /// By pixel; the number of samples beside them.
    pixels: Vec<(f64, Vec<FoldedEvent>)>,
    /// The table of the tangent.
    at: Option<AttenuationTable>,
    value: Vec<PixelMoments>,
    /// The tangent, class by class, and where each class ends.
    tangents: Jacobian,
    ends: Vec<usize>,
    /// Σ |d mean / d ln γ| of every class at the anchor.
    weights: Vec<f64>,
}

/// Moments of one pixel's folded events, and their derivatives by the classes that they depend on, in their order.
type Evaluated = ([f64; 4], Vec<(u16, PixelMoments)>);

/// Derivatives of one pixel by class while they are added up.
struct Scratch {
    slopes: Vec<PixelMoments>,
    /// Which of them are not zero, a bit each.
    seen: [u64; LEN.div_ceil(64)],
    /// α′ and dependences of the events of the pixel.
    gathered: PrefetchBuffer,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            slopes: vec![PixelMoments::default(); LEN],
            seen: [0; _],
            gathered: PrefetchBuffer::default(),
        }
    }
}

impl Scratch {
    #[inline]
    fn add(&mut self, class: GammaIndex, slope: PixelMoments, factor: f32) {
        let index = class.index();
        self.seen[index / 64] |= 1 << (index % 64);
        for (sum, s) in self.slopes[index].iter_mut().zip(slope) {
            *sum += s * factor;
        }
    }

    /// Hands the sums times `scale` out, and is empty again.
    fn take(&mut self, scale: f32) -> Vec<(u16, PixelMoments)> {
        let count = self.seen.iter().map(|word| word.count_ones()).sum::<u32>();
        let mut entries = Vec::with_capacity(count as usize);
        for (word, start) in self.seen.iter_mut().zip((0..).step_by(64)) {
            while *word != 0 {
                let index = start + word.trailing_zeros() as usize;
                *word &= *word - 1;
                let sum = std::mem::take(&mut self.slopes[index]);
                entries.push((index as u16, sum.map(|s| s * scale)));
            }
        }
        entries
    }
}

/// What a slope does to the mean.
fn size(slope: PixelMoments) -> f64 {
    f64::from(slope[0].abs() + slope[1].abs() + slope[2].abs())
}

/// The size below which the slopes of each class are left out: together they are less than a hundredth of the class.
fn floors(evaluated: &[Evaluated]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0u32); LEN];
    for (class, slope) in evaluated.iter().flat_map(|(_, slopes)| slopes) {
        let (sum, count) = &mut sums[usize::from(*class)];
        *sum += size(*slope);
        *count += 1;
    }
    let floor = |(sum, count): &(f64, u32)| FAINT * sum / f64::from((*count).max(1));
    sums.iter().map(floor).collect()
}

impl Folded {
    pub(in crate::train) fn new(recording: &Recording) -> Self {
        let (codes, all) = recording.codes.long();
        let mut place = vec![None; recording.codes.len()];
        for (code, of_all) in (0u32..).zip(all) {
            place[of_all as usize] = Some(code);
        }
        let pixels = (recording.pixels.iter())
            .map(|pixel| {
                let mut members = Vec::new();
                for path in &pixel.paths {
                    let events = &recording.events[path.first as usize..][..path.count as usize];
                    for &(mut event) in events {
                        if let Some(code) = place[event.code as usize] {
                            event.code = code;
                            let constant = path.constant;
                            members.push(FoldedEvent { constant, event });
                        }
                    }
                }
                (f64::from(pixel.samples.max(1)), members)
            })
            .collect();
        Self {
            codes,
            pixels,
            ..Self::default()
        }
    }

    pub(in crate::train) fn bytes(&self) -> usize {
        let members: usize = self.pixels.iter().map(|p| p.1.len()).sum();
        members * size_of::<FoldedEvent>() + self.tangents.len() * size_of::<(u32, [u16; 4])>()
    }

    /// Number of tangents.
    pub(in crate::train) fn work(&self) -> usize {
        self.tangents.len()
    }

    /// See [`MomentSource::add_weights`](crate::train::evaluate::moments::MomentSource::add_weights).
    pub(in crate::train) fn add_weights(&self, weights: &mut [f64]) {
        for (sum, weight) in weights.iter_mut().zip(&self.weights) {
            *sum += weight;
        }
    }

    fn is_empty(&self) -> bool {
        self.pixels.iter().all(|p| p.1.is_empty())
    }

    /// Evaluates all events and their derivatives at `table`.
    pub(in crate::train) fn anchor(&mut self, table: &AttenuationTable) {
        if self.is_empty() {
            return;
        }
        let roughness = self.codes.roughness(table);
        let evaluated: Vec<Evaluated> = (self.pixels.par_iter())
            .map_init(Scratch::default, |scratch, (samples, members)| {
                let mut sum = [0.0; 4];
                let mut gathered = std::mem::take(&mut scratch.gathered);
                roughness.gather(members.iter().map(|m| m.event.code), &mut gathered);
                let found = roughness.gathered(&gathered);
                for (FoldedEvent { constant, event }, (alpha, gradient)) in
                    members.iter().zip(found)
                {
                    let MeanAndSquare { x, mut y } = event.tangent(Dual::variable(alpha));
                    for (c, x) in constant.iter().zip(x) {
                        y = y + Dual::constant(2.0 * c) * x;
                    }
                    let parts = [x[0], x[1], x[2], y];
                    for (s, p) in sum.iter_mut().zip(parts) {
                        *s += f64::from(p.v);
                    }
                    for &(class, d) in gradient {
                        scratch.add(class, parts.map(|p| p.d), d);
                    }
                }
                scratch.gathered = gathered;
                (
                    sum.map(|s| s / samples),
                    scratch.take(1.0 / *samples as f32),
                )
            })
            .collect();
        self.value.clear();
        self.weights = vec![0.0; LEN];
        let floors = floors(&evaluated);
        let faint =
            |(class, slope): &(u16, PixelMoments)| size(*slope) < floors[usize::from(*class)];
        self.ends = vec![0; LEN];
        let slopes = evaluated.iter().flat_map(|(_, slopes)| slopes);
        for (class, _) in slopes.filter(|s| !faint(s)) {
            self.ends[usize::from(*class)] += 1;
        }
        let mut count = 0;
        for end in &mut self.ends {
            // Where the class begins, until its pixels are in.
            count += std::mem::replace(end, count);
        }
        self.tangents = Jacobian::zero(count);
        for (pixel, (sum, slopes)) in (0u32..).zip(&evaluated) {
            self.value.push(sum.map(|s| s as f32));
            for &(class, slope) in slopes {
                let index = usize::from(class);
                self.weights[index] += size(slope) * f64::from(table.gammas[index]);
                if !faint(&(class, slope)) {
                    self.tangents.set(self.ends[index], pixel, slope);
                    self.ends[index] += 1;
                }
            }
        }
        self.at = Some(table.clone());
    }

    /// Where the tangents of the classes are.
    fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| start..end)
    }

    /// Adds the events to the rows of their pixels, by the tangent from the anchor to a table.
    pub(in crate::train) fn follow(&self, table: &AttenuationTable, rows: &mut [PixelMoments]) {
        let Some(at) = &self.at else { return };
        for (row, value) in rows.iter_mut().zip(&self.value) {
            for c in 0..4 {
                row[c] += value[c];
            }
        }
        let factors = at.gammas.iter().zip(table.gammas.iter());
        for (range, (&from, &to)) in self.ranges().zip(factors) {
            self.tangents.follow(range, to - from, rows);
        }
    }

    /// Adds the events to the moments, each evaluated at the table.
    pub(in crate::train) fn add_exact(&self, table: &AttenuationTable, moments: &mut Moments) {
        if self.is_empty() {
            return;
        }
        let alphas = self.codes.alphas(table);
        let sums: Vec<[f64; 4]> = (self.pixels.par_iter())
            .map_init(Vec::new, |gathered, (samples, members)| {
                let mut sum = [0.0; 4];
                gathered.clear();
                gathered.extend(members.iter().map(|m| alphas[m.event.code as usize]));
                for (FoldedEvent { constant, event }, &alpha) in members.iter().zip(gathered.iter())
                {
                    let moment = event.at(alpha);
                    let mut second = moment.y;
                    for c in 0..3 {
                        sum[c] += f64::from(moment.x[c]);
                        second += 2.0 * constant[c] * moment.x[c];
                    }
                    sum[3] += f64::from(second);
                }
                sum.map(|s| s / samples)
            })
            .collect();
        for ((sum, mean), second) in sums.iter().zip(&mut moments.mean).zip(&mut moments.second) {
            for c in 0..3 {
                mean[c] += sum[c] as f32;
            }
            *second += sum[3] as f32;
        }
    }

    /// Adds dL/dγ.
    pub(in crate::train) fn gradient(&self, adjoint: &[PixelMoments], gradient: &mut [f64]) {
        for (g, range) in gradient.iter_mut().zip(self.ranges()) {
            *g += self.tangents.gradient(range, adjoint);
        }
    }
}
