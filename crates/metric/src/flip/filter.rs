//! Filters of FLIP: the blur of the eye, and detectors of edges and points. All are sums of separable kernels.

use std::f64::consts::PI;

use rayon::prelude::*;

/// A scalar image, row by row.
#[derive(Clone)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f64>,
}

/// Taps at −r … r.
pub(super) type Kernel = Vec<f64>;

/// Values of `f` at −r … r.
fn taps(radius: i32, f: impl Fn(f64) -> f64) -> Kernel {
    (-radius..=radius).map(|i| f(f64::from(i))).collect()
}

/// Scales positive taps to a sum of 1 and negative ones to −1.
fn normalised(kernel: Kernel) -> Kernel {
    let positive: f64 = kernel.iter().filter(|v| **v > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|v| **v < 0.0).sum::<f64>();
    kernel
        .iter()
        .map(|&v| {
            v / if v > 0.0 {
                positive
            } else {
                negative.max(f64::MIN_POSITIVE)
            }
        })
        .collect()
}

/// The eye's contrast sensitivity in one opponent channel: Σ aᵢ √(π / bᵢ) exp(−π² x² / bᵢ), x in degrees.
/// [FLIP20 (3), Table 1]
pub(super) struct Sensitivity(&'static [(f64, f64)]);

pub(super) const ACHROMATIC: Sensitivity = Sensitivity(&[(1.0, 0.0047)]);
pub(super) const RED_GREEN: Sensitivity = Sensitivity(&[(1.0, 0.0053)]);
pub(super) const BLUE_YELLOW: Sensitivity = Sensitivity(&[(34.1, 0.04), (13.5, 0.025)]);

impl Sensitivity {
    /// The largest b of all channels; it sets the radius, which is the same for all of them.
    const WIDEST: f64 = 0.04;

    /// Blurs a channel as the eye does at `ppd` pixels per degree.
    pub(super) fn blur(&self, plane: &Plane, ppd: f64) -> Plane {
        let radius = (3.0 * (Self::WIDEST / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i32;
        let parts: Vec<(f64, Kernel)> = self
            .0
            .iter()
            .map(|&(a, b)| {
                let kernel = taps(radius, |i| (-PI * PI * (i / ppd) * (i / ppd) / b).exp());
                let sum: f64 = kernel.iter().sum();
                (a * (PI / b).sqrt() * sum * sum, normalised(kernel))
            })
            .collect();
        let total: f64 = parts.iter().map(|(weight, _)| weight).sum();
        let mut out = vec![0.0; plane.values.len()];
        for (weight, kernel) in &parts {
            let blurred = convolve(plane, kernel, kernel);
            for (o, v) in out.iter_mut().zip(blurred.values) {
                *o += weight / total * v;
            }
        }
        Plane {
            values: out,
            ..*plane
        }
    }
}

/// Kernels of the feature detectors: along the feature's normal, and the Gaussian across. [FLIP20 §4.2.1]
pub(super) struct Detectors {
    edge: Kernel,
    point: Kernel,
    across: Kernel,
}

impl Detectors {
    /// Width of a feature in degrees.
    const WIDTH: f64 = 0.082;

    pub(super) fn new(ppd: f64) -> Self {
        let sigma = 0.5 * Self::WIDTH * ppd;
        let radius = (3.0 * sigma).ceil() as i32;
        let g = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        Self {
            edge: normalised(taps(radius, |x| -x * g(x))),
            point: normalised(taps(radius, |x| (x * x / (sigma * sigma) - 1.0) * g(x))),
            across: normalised(taps(radius, g)),
        }
    }

    /// Strengths of edges and of points.
    pub(super) fn apply(&self, plane: &Plane) -> (Plane, Plane) {
        (
            self.strength(plane, &self.edge),
            self.strength(plane, &self.point),
        )
    }

    fn strength(&self, plane: &Plane, along: &Kernel) -> Plane {
        let mut x = convolve(plane, along, &self.across);
        let y = convolve(plane, &self.across, along);
        for (a, b) in x.values.iter_mut().zip(y.values) {
            *a = a.hypot(b);
        }
        x
    }
}

/// Convolves rows with `kx` and columns with `ky`; beyond the border the nearest pixel is repeated.
pub(super) fn convolve(plane: &Plane, kx: &Kernel, ky: &Kernel) -> Plane {
    let (w, h) = (plane.width, plane.height);
    let radius = kx.len() / 2;
    let mut rows = vec![0.0; w * h];
    rows.par_chunks_mut(w)
        .zip(plane.values.par_chunks(w))
        .for_each(|(out, row)| {
            let mut padded = vec![row[0]; radius];
            padded.extend_from_slice(row);
            padded.resize(w + 2 * radius, row[w - 1]);
            for (i, k) in kx.iter().rev().enumerate() {
                for (o, v) in out.iter_mut().zip(&padded[i..]) {
                    *o += k * v;
                }
            }
        });
    let radius = ky.len() / 2;
    let mut values = vec![0.0; w * h];
    values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        for (i, k) in ky.iter().rev().enumerate() {
            let from = (y + i).saturating_sub(radius).min(h - 1);
            for (o, v) in out.iter_mut().zip(&rows[from * w..]) {
                *o += k * v;
            }
        }
    });
    Plane { values, ..*plane }
}
