//! Replay: every stored event is evaluated again at each table, exactly for the samples of the recording.

use crate::evaluate::{Adjoint, MomentSource, Moments, no_gradient};
use crate::record::event::{MeanAndSquare, PathSum};
use crate::record::recording::{RecordedPixel, Recording};
use opsr::math::real::Dual;
use opsr::regularise::AttenuationTable;
use rayon::prelude::*;

/// Pixels that a thread takes at once. Gradients are summed chunk by chunk, in order.
const CHUNK: usize = 128;

/// Evaluates the events of a recording.
pub struct Replay {
    recording: Recording,
}

/// An event of the current path.
struct ReplayedEvent {
    code: u32,
    from_lobe: bool,
    moment: MeanAndSquare<Dual>,
    /// Part of the path's sum that is not multiplied with this event: the event itself; for a lobe sample, all lobe
    /// samples of its vertex.
    alternatives: [f64; 3],
}

impl Replay {
    /// Takes a recording.
    pub fn new(recording: Recording) -> Self {
        Self { recording }
    }

    /// Moments of one pixel.
    fn pixel(&self, pixel: &RecordedPixel, alphas: &[f32]) -> ([f64; 3], f64) {
        let mut mean = pixel.constant;
        let mut second = pixel.constant_squared;
        for path in &pixel.paths {
            // M2 += y + 2 S x; S += x: the square of the sum, events in order of depth.
            let mut sum = PathSum::new(path.constant.map(f64::from));
            for event in self.recording.events_of(path) {
                let moment = event.at(alphas[event.code as usize]);
                let x = moment.mean.map(f64::from);
                let before = sum.add(event, x);
                second += f64::from(moment.square);
                for c in 0..3 {
                    second += 2.0 * before[c] * x[c];
                    mean[c] += x[c];
                }
            }
        }
        let n = f64::from(pixel.samples.max(1));
        (mean.map(|m| m / n), second / n)
    }

    /// dL/dα′ of every event of a chunk of pixels, with the event's code.
    fn chunk(
        &self,
        pixels: &[RecordedPixel],
        first: usize,
        alphas: &[f32],
        adjoint: &Adjoint,
    ) -> Vec<(u32, f64)> {
        let mut out = Vec::new();
        let mut events: Vec<ReplayedEvent> = Vec::new();
        for (i, pixel) in pixels.iter().enumerate() {
            let n = f64::from(pixel.samples.max(1));
            let mean = adjoint.mean[first + i].map(|a| f64::from(a) / n);
            let second = f64::from(adjoint.second[first + i]) / n;
            for path in &pixel.paths {
                events.clear();
                let mut total = path.constant.map(f64::from);
                // Sum of the lobe samples of the current vertex, and its first event.
                let mut from_lobe = [0.0; 3];
                let mut first = 0;
                for event in self.recording.events_of(path) {
                    let moment = event.at(Dual::variable(alphas[event.code as usize].into()));
                    if events.last().is_some_and(|e| e.code != event.code) {
                        set_alternatives(&mut events[first..], from_lobe);
                        (first, from_lobe) = (events.len(), [0.0; 3]);
                    }
                    for c in 0..3 {
                        total[c] += moment.mean[c].v;
                        from_lobe[c] += if event.from_lobe {
                            moment.mean[c].v
                        } else {
                            0.0
                        };
                    }
                    events.push(ReplayedEvent {
                        code: event.code,
                        from_lobe: event.from_lobe,
                        moment,
                        alternatives: moment.mean.map(|x| x.v),
                    });
                }
                set_alternatives(&mut events[first..], from_lobe);
                for event in &events {
                    // x_j is multiplied once with every other part of its path's sum:
                    // d(Σ 2 S x)/dx_j = 2 (total − alternatives).
                    let mut d = second * event.moment.square.d;
                    for c in 0..3 {
                        let rest = total[c] - event.alternatives[c];
                        d += (mean[c] + 2.0 * second * rest) * event.moment.mean[c].d;
                    }
                    out.push((event.code, d));
                }
            }
        }
        out
    }
}

/// Sets the alternatives of one vertex's lobe samples to the sum of them all.
fn set_alternatives(vertex: &mut [ReplayedEvent], from_lobe: [f64; 3]) {
    for event in vertex.iter_mut().filter(|e| e.from_lobe) {
        event.alternatives = from_lobe;
    }
}

impl MomentSource for Replay {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        let alphas = self.recording.lists.alphas(table);
        let sums: Vec<_> = self
            .recording
            .pixels
            .par_iter()
            .with_min_len(CHUNK)
            .map(|pixel| self.pixel(pixel, &alphas))
            .collect();
        Moments {
            mean: sums.iter().map(|s| s.0.map(|m| m as f32)).collect(),
            second: sums.iter().map(|s| s.1 as f32).collect(),
        }
    }

    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let lists = &self.recording.lists;
        let of_lists = lists.alphas_with_gradient(table);
        let alphas: Vec<f32> = lists.codes().map(|code| of_lists.at(code).0).collect();
        let chunks: Vec<Vec<(u32, f64)>> = self
            .recording
            .pixels
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(i, pixels)| self.chunk(pixels, i * CHUNK, &alphas, adjoint))
            .collect();
        let mut by_code = vec![0.0; lists.len()];
        for (code, d) in chunks.into_iter().flatten() {
            by_code[code as usize] += d;
        }
        let mut gradient = no_gradient();
        for (code, d) in lists.codes().zip(by_code) {
            for &(class, derivative) in of_lists.at(code).1 {
                gradient[class.index()] += d * f64::from(derivative);
            }
        }
        gradient
    }

    fn bytes(&self) -> usize {
        self.recording.bytes()
    }
}
