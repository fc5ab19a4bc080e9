//! FLIP: the difference a viewer sees when flipping between two pictures.
//!
//! LDR as in `[FLIP20]`: both pictures are blurred as by the eye and compared as colours (ΔE_c). Edges and points of
//! only one picture (ΔE_f) raise the difference: ΔE = ΔE_c^(1 − ΔE_f), in [0, 1] per pixel. HDR as in `[FLIP21]`: the
//! largest LDR error over several exposures, after the ACES tone curve. They show luminances of the reference from its
//! largest to its median just below white.

pub(crate) mod colour;
mod filter;

use glam::DVec3;
use rayon::prelude::*;

use super::{MetricError, check};
use filter::{ACHROMATIC, BLUE_YELLOW, Detectors, Plane, RED_GREEN};
use opsr::image::Buffer;
use opsr::image::display::{ACES, aces};

/// Pixels per degree of sight of the published default: a 4K display of 0.7 m at 0.7 m.
pub const DEFAULT_PPD: f64 = 67.0;

/// Error per pixel and its mean.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Error in [0, 1], row by row.
    pub values: Vec<f32>,
    /// Mean of `values`.
    pub mean: f64,
}

/// Exposures of HDR-FLIP, in stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// The exposure that puts the reference's brightest pixel just below white.
    pub start: f64,
    /// The exposure that puts the reference's median luminance there.
    pub stop: f64,
    /// Number of exposures, evenly spaced, both ends included.
    pub count: usize,
}

impl Exposures {
    fn step(&self, i: usize) -> f64 {
        let t = i as f64 / (self.count - 1).max(1) as f64;
        self.start + t * (self.stop - self.start)
    }
}

/// LDR-FLIP of pictures in linear sRGB, clamped to [0, 1], at `ppd` pixels per degree.
pub fn ldr(test: &Buffer, reference: &Buffer, ppd: f64) -> Result<FlipMap, MetricError> {
    check(test, reference)?;
    check_ppd(ppd)?;
    let linear = |b: &Buffer| b.pixels.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>();
    let values = difference(linear(test), linear(reference), reference.size(), ppd);
    Ok(FlipMap::new(reference.size(), values))
}

/// HDR-FLIP of pictures in linear sRGB at `ppd` pixels per degree, over [`exposures`] of the reference.
pub fn hdr(
    test: &Buffer,
    reference: &Buffer,
    ppd: f64,
) -> Result<(FlipMap, Exposures), MetricError> {
    check(test, reference)?;
    check_ppd(ppd)?;
    let exposures = exposures(reference)?;
    let mut worst = vec![0.0; reference.pixels.len()];
    for i in 0..exposures.count {
        let scale = exposures.step(i).exp2();
        let shown = |b: &Buffer| {
            b.pixels
                .iter()
                .map(|p| aces(p.as_dvec3() * scale))
                .collect::<Vec<_>>()
        };
        let values = difference(shown(test), shown(reference), reference.size(), ppd);
        for (w, v) in worst.iter_mut().zip(values) {
            *w = v.max(*w);
        }
    }
    Ok((FlipMap::new(reference.size(), worst), exposures))
}

fn check_ppd(ppd: f64) -> Result<(), MetricError> {
    // Above, the kernels would be wider than any picture.
    if (1.0..=1000.0).contains(&ppd) {
        Ok(())
    } else {
        Err(MetricError::PixelsPerDegree(ppd))
    }
}

impl FlipMap {
    fn new((width, height): (usize, usize), values: Vec<f64>) -> Self {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        Self {
            width,
            height,
            values: values.into_iter().map(|v| v as f32).collect(),
            mean,
        }
    }
}

// ── HDR: exposures and tone curve ──

/// Exposures from the one that shows the reference's largest luminance as t = 0.85 to the one that shows its median so.
/// [FLIP21 §3]
pub fn exposures(reference: &Buffer) -> Result<Exposures, MetricError> {
    const T: f64 = 0.85;
    check(reference, reference)?;
    let [k0, k1, k2, k3, k4, k5] = ACES;
    let (a, b, c) = (k0 - T * k3, k1 - T * k4, k2 - T * k5);
    let shown = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);

    let weights = DVec3::new(0.2126, 0.7152, 0.0722);
    let mut luminance: Vec<f64> = reference
        .pixels
        .iter()
        .map(|p| p.as_dvec3().dot(weights))
        .collect();
    luminance.sort_unstable_by(f64::total_cmp);
    let brightest = luminance[luminance.len() - 1];
    if brightest <= 0.0 {
        return Err(MetricError::BlackReference);
    }
    // As in the authors' program: the upper of two middle values, and not below single precision's ε.
    let median = luminance[luminance.len() / 2]
        .max(f64::from(f32::EPSILON))
        .min(brightest);
    let (start, stop) = ((shown / brightest).log2(), (shown / median).log2());
    Ok(Exposures {
        start,
        stop,
        count: ((stop - start).ceil() as usize).max(2),
    })
}

// ── LDR ──

/// Exponent of the colour difference, and the knee above which large differences are compressed. [FLIP20 §4.1.5]
const COLOUR_EXPONENT: f64 = 0.7;
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;
/// Exponent of the feature difference. [FLIP20 §4.2.2]
const FEATURE_EXPONENT: f64 = 0.5;

/// Quantities of one picture that are compared.
struct Seen {
    lab: Vec<DVec3>,
    edges: Plane,
    points: Plane,
}

fn difference(test: Vec<DVec3>, reference: Vec<DVec3>, size: (usize, usize), ppd: f64) -> Vec<f64> {
    let detectors = Detectors::new(ppd);
    let (test, reference) = (
        seen(test, size, ppd, &detectors),
        seen(reference, size, ppd, &detectors),
    );
    let largest =
        colour::hyab(colour::hunt_lab(DVec3::Y), colour::hunt_lab(DVec3::Z)).powf(COLOUR_EXPONENT);
    let bend = KNEE * largest;
    (0..test.lab.len())
        .into_par_iter()
        .map(|i| {
            let d = colour::hyab(test.lab[i], reference.lab[i]).powf(COLOUR_EXPONENT);
            let colour = if d < bend {
                KNEE_VALUE / bend * d
            } else {
                KNEE_VALUE + (d - bend) / (largest - bend) * (1.0 - KNEE_VALUE)
            };
            let edge = (test.edges.values[i] - reference.edges.values[i]).abs();
            let point = (test.points.values[i] - reference.points.values[i]).abs();
            let feature =
                (std::f64::consts::FRAC_1_SQRT_2 * edge.max(point)).powf(FEATURE_EXPONENT);
            colour.min(1.0).powf(1.0 - feature.min(1.0))
        })
        .collect()
}

fn seen(
    linear: Vec<DVec3>,
    (width, height): (usize, usize),
    ppd: f64,
    detectors: &Detectors,
) -> Seen {
    let opponent: Vec<DVec3> = linear
        .into_par_iter()
        .map(|c| colour::opponent(c.clamp(DVec3::ZERO, DVec3::ONE)))
        .collect();
    let plane = |f: &(dyn Fn(&DVec3) -> f64 + Sync)| Plane {
        width,
        height,
        values: opponent.iter().map(f).collect(),
    };
    let (edges, points) = detectors.apply(&plane(&|c| (c.x + 16.0) / 116.0));
    let a = ACHROMATIC.blur(&plane(&|c| c.x), ppd).values;
    let rg = RED_GREEN.blur(&plane(&|c| c.y), ppd).values;
    let by = BLUE_YELLOW.blur(&plane(&|c| c.z), ppd).values;
    let lab = (0..a.len())
        .into_par_iter()
        .map(|i| {
            let blurred = colour::opponent_to_rgb(DVec3::new(a[i], rg[i], by[i]));
            colour::hunt_lab(blurred.clamp(DVec3::ZERO, DVec3::ONE))
        })
        .collect();
    Seen { lab, edges, points }
}
