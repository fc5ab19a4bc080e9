//! Events on paths of more than five vertices, whose roughness values fold (`docs/method.md` section 2): each depends
//! on the factors of several classes.
//!
//! They are evaluated exactly, with derivatives, at one table, the anchor. Tables near the anchor use its tangent.

use crate::evaluate::Moments;
use crate::evaluate::jacobian::{Jacobian, PixelMoments};
use crate::record::event::StoredEvent;
use crate::record::lists::{PrefetchBuffer, RoughnessLists};
use crate::record::recording::Recording;
use opsr::math::real::{Dual, Real};
use opsr::regularise::{AttenuationTable, GammaIndex, LEN};
use rayon::prelude::*;
use std::ops::Range;

/// Share of the mean derivative of its class below which a derivative is dropped. On the crops with the most folded
/// paths 12 to 35 % of all derivatives are below a hundredth of the mean, with 0.04 % of their sum, and 35 to 53 %
/// below a tenth, with 0.9 %.
const FAINT: f64 = 0.03;

/// An event and the part of its path that does not depend on the table.
struct FoldedEvent {
    constant: [f32; 3],
    event: StoredEvent,
}

/// The folded events of a crop.
#[derive(Default)]
pub(crate) struct Folded {
    /// Lists of the events, all of them long.
    lists: RoughnessLists,
    /// The events, pixel by pixel, in one vector of exact capacity: one vector for each pixel would take half as much
    /// memory again.
    events: Vec<FoldedEvent>,
    /// Number of samples and range of the events, by pixel.
    pixels: Vec<(f64, Range<usize>)>,
    /// Table of the tangent.
    anchor: Option<AttenuationTable>,
    /// Moments at the anchor.
    value: Vec<PixelMoments>,
    /// Derivatives at the anchor, class by class, and the end of each class.
    jacobian: Jacobian,
    ends: Vec<usize>,
    /// Σ |d mean / d ln γ| of every class at the anchor.
    weights: Vec<f64>,
}

/// Moments of one pixel's folded events, and their derivatives by class in ascending order.
type FoldedPixel = ([f64; 4], Vec<(u16, PixelMoments)>);

/// Derivatives of one pixel by class while they are summed.
struct Scratch {
    derivatives: Vec<PixelMoments>,
    /// One bit for each class with a derivative.
    seen: [u64; LEN.div_ceil(64)],
    buffer: PrefetchBuffer,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            derivatives: vec![PixelMoments::default(); LEN],
            seen: [0; _],
            buffer: PrefetchBuffer::default(),
        }
    }
}

impl Scratch {
    #[inline]
    fn add(&mut self, class: GammaIndex, derivative: PixelMoments, factor: f32) {
        let index = class.index();
        self.seen[index / 64] |= 1 << (index % 64);
        for (sum, d) in self.derivatives[index].iter_mut().zip(derivative) {
            *sum += d * factor;
        }
    }

    /// Removes the sums and returns them times `scale`, in ascending order of class.
    fn take(&mut self, scale: f32) -> Vec<(u16, PixelMoments)> {
        let count = self.seen.iter().map(|word| word.count_ones()).sum::<u32>();
        let mut entries = Vec::with_capacity(count as usize);
        for (word, start) in self.seen.iter_mut().zip((0..).step_by(64)) {
            while *word != 0 {
                let index = start + word.trailing_zeros() as usize;
                *word &= *word - 1;
                let sum = std::mem::take(&mut self.derivatives[index]);
                entries.push((index as u16, sum.map(|d| d * scale)));
            }
        }
        entries
    }
}

/// Size of a derivative of the mean.
fn size(derivative: PixelMoments) -> f64 {
    f64::from(derivative[0].abs() + derivative[1].abs() + derivative[2].abs())
}

/// Size below which the derivatives of each class are dropped.
fn thresholds(evaluated: &[FoldedPixel]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0u32); LEN];
    for (class, derivative) in evaluated.iter().flat_map(|(_, derivatives)| derivatives) {
        let (sum, count) = &mut sums[usize::from(*class)];
        *sum += size(*derivative);
        *count += 1;
    }
    let threshold = |(sum, count): &(f64, u32)| FAINT * sum / f64::from((*count).max(1));
    sums.iter().map(threshold).collect()
}

impl Folded {
    /// The events of a recording whose paths fold.
    pub(crate) fn new(recording: &Recording) -> Self {
        let (lists, all) = recording.lists.long();
        let mut place = vec![None; recording.lists.len()];
        for (code, of_all) in (0u32..).zip(all) {
            place[of_all as usize] = Some(code);
        }
        let code_of = |event: &StoredEvent| place[event.code as usize];
        let count = recording
            .events
            .iter()
            .filter(|event| code_of(event).is_some());
        let mut events = Vec::with_capacity(count.count());
        let pixels = recording
            .pixels
            .iter()
            .map(|pixel| {
                let start = events.len();
                for path in &pixel.paths {
                    for &(mut event) in recording.events_of(path) {
                        if let Some(code) = code_of(&event) {
                            event.code = code;
                            let constant = path.constant;
                            events.push(FoldedEvent { constant, event });
                        }
                    }
                }
                (f64::from(pixel.samples.max(1)), start..events.len())
            })
            .collect();
        Self {
            lists,
            events,
            pixels,
            ..Self::default()
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.events.as_slice()) + self.jacobian.len() * size_of::<(u32, [u16; 4])>()
    }

    /// Number of derivatives.
    pub(crate) fn work(&self) -> usize {
        self.jacobian.len()
    }

    /// See [`MomentSource::add_weights`](crate::evaluate::MomentSource::add_weights).
    pub(crate) fn add_weights(&self, weights: &mut [f64]) {
        for (sum, weight) in weights.iter_mut().zip(&self.weights) {
            *sum += weight;
        }
    }

    fn is_empty(&self) -> bool {
        self.events.is_empty()
    }

    /// Evaluates all events and their derivatives at `table`.
    pub(crate) fn anchor(&mut self, table: &AttenuationTable) {
        if self.is_empty() {
            return;
        }
        let alphas = self.lists.alphas_with_gradient(table);
        let evaluated: Vec<FoldedPixel> = self
            .pixels
            .par_iter()
            .map_init(Scratch::default, |scratch, (samples, range)| {
                let events = &self.events[range.clone()];
                let mut sum = [0.0; 4];
                let mut buffer = std::mem::take(&mut scratch.buffer);
                alphas.prefetch(events.iter().map(|e| e.event.code), &mut buffer);
                let found = alphas.prefetched(&buffer);
                for (FoldedEvent { constant, event }, (alpha, gradient)) in events.iter().zip(found)
                {
                    let moment = event.tangent(Dual::variable(alpha));
                    let (x, mut y) = (moment.mean, moment.square);
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
                scratch.buffer = buffer;
                (
                    sum.map(|s| s / samples),
                    scratch.take(1.0 / *samples as f32),
                )
            })
            .collect();
        self.set_tangent(table, &evaluated);
    }

    /// Stores the moments and derivatives of all pixels at `table`, reordered by class.
    fn set_tangent(&mut self, table: &AttenuationTable, evaluated: &[FoldedPixel]) {
        self.value.clear();
        self.weights = vec![0.0; LEN];
        let thresholds = thresholds(evaluated);
        let faint = |class: u16, derivative| size(derivative) < thresholds[usize::from(class)];
        self.ends = vec![0; LEN];
        for &(class, derivative) in evaluated.iter().flat_map(|(_, derivatives)| derivatives) {
            self.ends[usize::from(class)] += usize::from(!faint(class, derivative));
        }
        let mut count = 0;
        for end in &mut self.ends {
            // The start of the class; it becomes the end while elements are set.
            count += std::mem::replace(end, count);
        }
        self.jacobian = Jacobian::zero(count);
        for (pixel, (sum, derivatives)) in (0u32..).zip(evaluated) {
            self.value.push(sum.map(|s| s as f32));
            for &(class, derivative) in derivatives {
                let index = usize::from(class);
                self.weights[index] += size(derivative) * f64::from(table.gammas[index]);
                if !faint(class, derivative) {
                    self.jacobian.set(self.ends[index], pixel, derivative);
                    self.ends[index] += 1;
                }
            }
        }
        self.anchor = Some(table.clone());
    }

    /// Range of each class in the Jacobian.
    fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| start..end)
    }

    /// Adds the moments of the events to their pixels, extrapolated by the tangent from the anchor to a table.
    pub(crate) fn follow(&self, table: &AttenuationTable, pixels: &mut [PixelMoments]) {
        let Some(anchor) = &self.anchor else { return };
        for (pixel, value) in pixels.iter_mut().zip(&self.value) {
            for c in 0..4 {
                pixel[c] += value[c];
            }
        }
        let factors = anchor.gammas.iter().zip(table.gammas.iter());
        for (range, (&from, &to)) in self.ranges().zip(factors) {
            self.jacobian.follow(range, to - from, pixels);
        }
    }

    /// Adds the moments of the events, each evaluated at the table.
    pub(crate) fn add_exact(&self, table: &AttenuationTable, moments: &mut Moments) {
        if self.is_empty() {
            return;
        }
        let alphas = self.lists.alphas(table);
        let sums: Vec<[f64; 4]> = self
            .pixels
            .par_iter()
            .map_init(Vec::new, |of_events, (samples, range)| {
                let events = &self.events[range.clone()];
                let mut sum = [0.0; 4];
                // In a loop of its own for the same reason as `ListAlphas::prefetch`.
                of_events.clear();
                of_events.extend(events.iter().map(|e| alphas[e.event.code as usize]));
                for (FoldedEvent { constant, event }, &alpha) in events.iter().zip(of_events.iter())
                {
                    let moment = event.at(alpha);
                    let mut second = moment.square;
                    for c in 0..3 {
                        sum[c] += f64::from(moment.mean[c]);
                        second += 2.0 * constant[c] * moment.mean[c];
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
    pub(crate) fn gradient(&self, adjoint: &[PixelMoments], gradient: &mut [f64]) {
        for (g, range) in gradient.iter_mut().zip(self.ranges()) {
            *g += self.jacobian.gradient(range, adjoint);
        }
    }
}
