//! Events of paths of more than five vertices, whose roughness folds: each depends on the factors of several classes.
//!
//! They are evaluated exactly, with derivatives, at one table, the anchor, and followed by the tangent from there until
//! the factors have moved too far.

use super::codes::Codes;
use super::event::StoredEvent;
use super::grid::Level;
use super::moments::Moments;
use super::recording::Recording;
use super::sums::{Slopes, Sums};
use crate::math::real::Dual;
use crate::regularise::{AttenuationTable, GammaIndex, LEN};
use rayon::prelude::*;

/// An event, what else its path carries, and the share of a sample in its pixel's mean.
struct Member {
    constant: [f32; 3],
    event: StoredEvent,
}

/// The folded events of a crop.
#[derive(Default)]
pub(super) struct Folded {
    codes: Codes,
    /// By pixel; the number of samples beside them.
    pixels: Vec<(f64, Vec<Member>)>,
    /// The table of the tangent.
    at: Option<AttenuationTable>,
    value: Moments,
    /// The tangent, by class.
    tangents: Vec<Tangent>,
    /// Of all tangents at their levels.
    sums: Sums,
    /// Σ |d mean / d ln γ| of every class at the anchor.
    weights: Vec<f64>,
}

/// The tangent of one class.
#[derive(Default)]
struct Tangent {
    /// Where the factor was when the moments were last asked for, and how far that is from the anchor.
    level: Option<(Level, f32)>,
    slopes: Slopes,
}

/// Moments of one pixel's folded events, and their derivatives by the classes that they depend on, in their order.
type Evaluated = ([f64; 4], Vec<(u16, [f64; 4])>);

/// Derivatives of one pixel by class while they are added up.
struct Scratch {
    slopes: Vec<[f64; 4]>,
    seen: Vec<bool>,
    classes: Vec<u16>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            slopes: vec![[0.0; 4]; LEN],
            seen: vec![false; LEN],
            classes: Vec::new(),
        }
    }
}

impl Scratch {
    #[inline]
    fn add(&mut self, class: GammaIndex, slope: [f64; 4], factor: f64) {
        let index = class.index();
        if !std::mem::replace(&mut self.seen[index], true) {
            self.classes.push(index as u16);
        }
        for (sum, s) in self.slopes[index].iter_mut().zip(slope) {
            *sum += s * factor;
        }
    }

    /// Hands the sums out, and is empty again.
    fn take(&mut self) -> Vec<(u16, [f64; 4])> {
        self.classes.sort_unstable();
        let classes = self.classes.drain(..);
        let entries = classes.map(|class| {
            let index = usize::from(class);
            self.seen[index] = false;
            (class, std::mem::take(&mut self.slopes[index]))
        });
        entries.collect()
    }
}

impl Folded {
    pub(super) fn new(recording: &Recording) -> Self {
        let pixels = (recording.pixels.iter())
            .map(|pixel| {
                let mut members = Vec::new();
                for path in &pixel.paths {
                    let events = &recording.events[path.first as usize..][..path.count as usize];
                    let long = events.iter().filter(|e| recording.codes.is_long(e.code));
                    members.extend(long.map(|&event| Member {
                        constant: path.constant,
                        event,
                    }));
                }
                (f64::from(pixel.samples.max(1)), members)
            })
            .collect();
        Self {
            codes: recording.codes.clone(),
            pixels,
            ..Self::default()
        }
    }

    pub(super) fn bytes(&self) -> usize {
        let members: usize = self.pixels.iter().map(|p| p.1.len()).sum();
        let slopes: usize = self.tangents.iter().map(|t| t.slopes.pixels.len()).sum();
        members * size_of::<Member>() + slopes * size_of::<(u32, [f32; 4])>()
    }

    /// See [`Source::movement`](super::moments::Source::movement).
    pub(super) fn movement(&self, table: &AttenuationTable) -> (f64, f64) {
        let Some(at) = &self.at else {
            return (0.0, 0.0);
        };
        let factors = at.gammas.iter().zip(table.gammas.iter());
        let mut sums = (0.0, 0.0);
        for ((&a, &b), &weight) in factors.zip(&self.weights) {
            if weight > 0.0 {
                sums.0 += weight * f64::from((b / a).ln().abs());
                sums.1 += weight;
            }
        }
        sums
    }

    fn is_empty(&self) -> bool {
        self.pixels.iter().all(|p| p.1.is_empty())
    }

    /// Evaluates all events and their derivatives at `table`.
    pub(super) fn anchor(&mut self, table: &AttenuationTable) {
        if self.is_empty() {
            return;
        }
        let roughness = self.codes.long_roughness(table);
        let evaluated: Vec<Evaluated> = (self.pixels.par_iter())
            .map_init(Scratch::default, |scratch, (samples, members)| {
                let mut sum = [0.0; 4];
                for Member { constant, event } in members {
                    let (alpha, gradient) = roughness.at(event.code);
                    let moment = event.at(Dual::variable(alpha.into()));
                    let mut second = moment.y;
                    for (c, x) in constant.iter().zip(moment.x) {
                        second = second
                            + Dual {
                                v: 2.0 * f64::from(*c),
                                d: 0.0,
                            } * x;
                    }
                    let parts = [moment.x[0], moment.x[1], moment.x[2], second];
                    for (s, p) in sum.iter_mut().zip(parts) {
                        *s += p.v / samples;
                    }
                    let slope = parts.map(|p| p.d / samples);
                    for &(class, d) in gradient {
                        scratch.add(class, slope, f64::from(d));
                    }
                }
                (sum, scratch.take())
            })
            .collect();
        self.value = Moments::zero(evaluated.len());
        self.weights = vec![0.0; LEN];
        self.tangents.clear();
        self.tangents.resize_with(LEN, Tangent::default);
        let mut bound = [0.0f64; 4];
        for (pixel, (sum, slopes)) in (0u32..).zip(evaluated) {
            self.value.mean[pixel as usize] = [sum[0] as f32, sum[1] as f32, sum[2] as f32];
            self.value.second[pixel as usize] = sum[3] as f32;
            let mut steepest = [0.0f64; 4];
            for (class, slope) in slopes {
                let class = usize::from(class);
                let light = slope[0].abs() + slope[1].abs() + slope[2].abs();
                self.weights[class] += light * f64::from(table.gammas[class]);
                let tangent = &mut self.tangents[class].slopes;
                tangent.pixels.push(pixel);
                tangent.values.push(slope.map(|s| s as f32));
                for (sum, s) in steepest.iter_mut().zip(slope) {
                    *sum += if s.is_finite() { s.abs() } else { 0.0 };
                }
            }
            // Factors move by at most 1.
            bound = [0, 1, 2, 3].map(|c| bound[c].max(steepest[c]));
        }
        self.sums = Sums::new(self.value.mean.len(), bound);
        self.at = Some(table.clone());
    }

    /// Follows the tangent to the levels of a table.
    pub(super) fn step(&mut self, table: &AttenuationTable) {
        let Some(at) = &self.at else { return };
        let factors = at.gammas.iter().zip(table.gammas.iter());
        for (tangent, (&from, &to)) in self.tangents.iter_mut().zip(factors) {
            if tangent.slopes.pixels.is_empty() {
                continue;
            }
            let level = Level::of(to);
            if tangent.level.is_some_and(|(l, _)| l == level) {
                continue;
            }
            let moved = level.gamma() - from;
            let before = tangent.level.replace((level, moved)).map_or(0.0, |l| l.1);
            for (&pixel, slope) in tangent.slopes.pixels.iter().zip(&tangent.slopes.values) {
                let along = |moved: f32| slope.map(|s| s * moved);
                self.sums.exchange(pixel, along(before), along(moved));
            }
        }
    }

    /// Adds the events to the moments, by the tangent from the anchor to where it was followed last.
    pub(super) fn add(&self, moments: &mut Moments) {
        if self.at.is_none() {
            return;
        }
        let values = self.value.mean.iter().zip(&self.value.second);
        let pixels = moments.mean.iter_mut().zip(&mut moments.second);
        for ((mean, second), (value, value2)) in pixels.zip(values) {
            for (m, v) in mean.iter_mut().zip(value) {
                *m += v;
            }
            *second += value2;
        }
        self.sums.add_to(moments);
    }

    /// Adds the events to the moments, each evaluated at the table.
    pub(super) fn add_exact(&self, table: &AttenuationTable, moments: &mut Moments) {
        if self.is_empty() {
            return;
        }
        let alphas = self.codes.long_alphas(table);
        let sums: Vec<[f64; 4]> = (self.pixels.par_iter())
            .map(|(samples, members)| {
                let mut sum = [0.0; 4];
                for Member { constant, event } in members {
                    let moment = event.at(alphas[event.code as usize]);
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
    pub(super) fn gradient(&self, adjoint: &[[f32; 4]], gradient: &mut [f64]) {
        for (g, tangent) in gradient.iter_mut().zip(&self.tangents) {
            let all = 0..tangent.slopes.pixels.len();
            *g += tangent.slopes.gradient(all, adjoint);
        }
    }
}
