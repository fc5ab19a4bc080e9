//! Events of paths of more than five vertices, whose roughness folds: each depends on the factors of several classes.
//!
//! They are evaluated exactly, with derivatives, at one table, the anchor, and followed by the tangent from there until
//! the factors have moved too far.

use super::codes::Codes;
use super::event::StoredEvent;
use super::moments::{Adjoint, Moments};
use super::recording::Recording;
use crate::math::real::Dual;
use crate::regularise::{AttenuationTable, LEN};
use rayon::prelude::*;
use std::collections::BTreeMap;

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
    /// Derivatives of (mean, second) by (class, pixel), where there are any.
    slopes: Vec<(u16, u32, [f32; 4])>,
    /// Σ |d mean / d ln γ| of every class at the anchor.
    weights: Vec<f64>,
}

/// Moments of one pixel's folded events with their derivatives by class.
type Tangent = ([f64; 4], BTreeMap<u16, [f64; 4]>);

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
        members * size_of::<Member>() + size_of_val(self.slopes.as_slice())
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
        let tangents: Vec<Tangent> = (self.pixels.par_iter())
            .map(|(samples, members)| {
                let mut sum = [0.0; 4];
                let mut slopes: BTreeMap<u16, [f64; 4]> = BTreeMap::new();
                for Member { constant, event } in members {
                    let r = &roughness[event.code as usize];
                    let moment = event.at(Dual::variable(r.alpha.into()));
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
                    for &(class, d) in &r.gradient {
                        let slope = slopes.entry(class.index() as u16).or_default();
                        for (s, p) in slope.iter_mut().zip(parts) {
                            *s += p.d * f64::from(d) / samples;
                        }
                    }
                }
                (sum, slopes)
            })
            .collect();
        self.value = Moments::zero(tangents.len());
        self.slopes.clear();
        self.weights = vec![0.0; LEN];
        for (pixel, (sum, slopes)) in tangents.into_iter().enumerate() {
            self.value.mean[pixel] = [sum[0] as f32, sum[1] as f32, sum[2] as f32];
            self.value.second[pixel] = sum[3] as f32;
            for (class, slope) in slopes {
                let light = slope[0].abs() + slope[1].abs() + slope[2].abs();
                let gamma = table.gammas[usize::from(class)];
                self.weights[usize::from(class)] += light * f64::from(gamma);
                self.slopes
                    .push((class, pixel as u32, slope.map(|s| s as f32)));
            }
        }
        self.at = Some(table.clone());
    }

    /// Adds the events to the moments, by the tangent from the anchor.
    pub(super) fn add(&self, table: &AttenuationTable, moments: &mut Moments) {
        let Some(at) = &self.at else { return };
        let mut moved = [0.0f32; LEN];
        for (m, (a, b)) in moved
            .iter_mut()
            .zip(at.gammas.iter().zip(table.gammas.iter()))
        {
            *m = b - a;
        }
        for (pixel, (mean, second)) in moments.mean.iter_mut().zip(&mut moments.second).enumerate()
        {
            for (m, value) in mean.iter_mut().zip(self.value.mean[pixel]) {
                *m += value;
            }
            *second += self.value.second[pixel];
        }
        for &(class, pixel, slope) in &self.slopes {
            let step = moved[usize::from(class)];
            let mean = &mut moments.mean[pixel as usize];
            for c in 0..3 {
                mean[c] += step * slope[c];
            }
            moments.second[pixel as usize] += step * slope[3];
        }
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
    pub(super) fn gradient(&self, adjoint: &Adjoint, gradient: &mut [f64]) {
        for &(class, pixel, slope) in &self.slopes {
            let mean = adjoint.mean[pixel as usize];
            let d = mean[0] * slope[0]
                + mean[1] * slope[1]
                + mean[2] * slope[2]
                + adjoint.second[pixel as usize] * slope[3];
            gradient[usize::from(class)] += f64::from(d);
        }
    }
}
