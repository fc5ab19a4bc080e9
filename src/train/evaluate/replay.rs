//! Replay: every stored event is evaluated again at each table. Exact for the samples of the recording.

use crate::math::real::Dual;
use crate::regularise::AttenuationTable;
use crate::train::evaluate::moments::{Adjoint, MomentSource, Moments, no_gradient};
use crate::train::record::event::{MeanAndSquare, PathSum};
use crate::train::record::recording::{RecordedPath, RecordedPixel, Recording};
use rayon::prelude::*;

/// Pixels that a thread takes at once; sums are made in their order.
const CHUNK: usize = 128;

/// Evaluates a recording.
pub struct Replay {
    recording: Recording,
}

impl Replay {
    /// Of a recording.
    pub fn new(recording: Recording) -> Self {
        Self { recording }
    }

    /// ExactSums of one pixel.
    fn pixel(&self, pixel: &RecordedPixel, alphas: &[f32]) -> ([f64; 3], f64) {
        let mut mean = pixel.constant;
        let mut second = pixel.constant_squared;
        for path in &pixel.paths {
            // M2 += y + 2 S x; S += x: the square of the sum, events in order of depth.
            let mut sum = PathSum::new(path.constant.map(f64::from));
            for event in self.events(path) {
                let moment = event.at(alphas[event.code as usize]);
                let x = moment.x.map(f64::from);
                let before = sum.meet(event, x);
                second += f64::from(moment.y);
                for c in 0..3 {
                    second += 2.0 * before[c] * x[c];
                    mean[c] += x[c];
                }
            }
        }
        let n = f64::from(pixel.samples.max(1));
        (mean.map(|m| m / n), second / n)
    }

    fn events(&self, path: &RecordedPath) -> &[crate::train::record::event::StoredEvent] {
        &self.recording.events[path.first as usize..][..path.count as usize]
    }

    /// dL/dα′ of every code, from the pixels of a chunk.
    fn chunk(
        &self,
        pixels: &[RecordedPixel],
        first: usize,
        alphas: &[f32],
        adjoint: &Adjoint,
    ) -> Vec<(u32, f64)> {
        let mut out = Vec::new();
        let mut moments: Vec<ReplayedEvent> = Vec::new();
        for (i, pixel) in pixels.iter().enumerate() {
            let n = f64::from(pixel.samples.max(1));
            let mean = adjoint.mean[first + i].map(|a| f64::from(a) / n);
            let second = f64::from(adjoint.second[first + i]) / n;
            for path in &pixel.paths {
                moments.clear();
                let mut total = path.constant.map(f64::from);
                // What is found from one vertex, whose draws do not meet one another.
                let mut found = [0.0; 3];
                let mut first = 0;
                for event in self.events(path) {
                    let moment = event.at(Dual::variable(alphas[event.code as usize].into()));
                    if moments
                        .last()
                        .is_some_and(|m: &ReplayedEvent| m.code != event.code)
                    {
                        close(&mut moments[first..], found);
                        (first, found) = (moments.len(), [0.0; 3]);
                    }
                    for c in 0..3 {
                        total[c] += moment.x[c].v;
                        found[c] += if event.found { moment.x[c].v } else { 0.0 };
                    }
                    moments.push(ReplayedEvent {
                        code: event.code,
                        found: event.found,
                        moment,
                        apart: moment.x.map(|x| x.v),
                    });
                }
                close(&mut moments[first..], found);
                for ReplayedEvent {
                    code,
                    moment,
                    apart,
                    ..
                } in &moments
                {
                    // x_j meets every other part of its path's sum once: d(Σ 2 S x)/dx_j = 2 (total − apart).
                    let mut d = second * moment.y.d;
                    for c in 0..3 {
                        d += (mean[c] + 2.0 * second * (total[c] - apart[c])) * moment.x[c].d;
                    }
                    out.push((*code, d));
                }
            }
        }
        out
    }
}

/// An event of the path at hand.
struct ReplayedEvent {
    code: u32,
    found: bool,
    moment: MeanAndSquare<Dual>,
    /// What of the path's sum it does not meet: itself, and what else is found from its vertex.
    apart: [f64; 3],
}

/// Sets what does not meet among the events of one vertex.
fn close(vertex: &mut [ReplayedEvent], found: [f64; 3]) {
    for event in vertex.iter_mut().filter(|e| e.found) {
        event.apart = found;
    }
}

impl MomentSource for Replay {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        let alphas = self.recording.codes.alphas(table);
        let sums: Vec<_> = (self.recording.pixels.par_iter().with_min_len(CHUNK))
            .map(|pixel| self.pixel(pixel, &alphas))
            .collect();
        Moments {
            mean: sums.iter().map(|s| s.0.map(|m| m as f32)).collect(),
            second: sums.iter().map(|s| s.1 as f32).collect(),
        }
    }

    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let roughness = self.recording.codes.roughness(table);
        let codes = 0..self.recording.codes.len() as u32;
        let alphas: Vec<f32> = codes.map(|code| roughness.at(code).0).collect();
        let chunks: Vec<Vec<(u32, f64)>> = (self.recording.pixels.par_chunks(CHUNK).enumerate())
            .map(|(i, pixels)| self.chunk(pixels, i * CHUNK, &alphas, adjoint))
            .collect();
        let mut by_code = vec![0.0; self.recording.codes.len()];
        for (code, d) in chunks.into_iter().flatten() {
            by_code[code as usize] += d;
        }
        let mut gradient = no_gradient();
        for (code, d) in (0u32..).zip(by_code) {
            for &(class, slope) in roughness.at(code).1 {
                gradient[class.index()] += d * f64::from(slope);
            }
        }
        gradient
    }

    fn bytes(&self) -> usize {
        self.recording.bytes()
    }
}
