//! Phase functions: densities and samples against the cumulative distribution.

use crate::bsdf::{Bsdf, Phase};
use crate::math::{Frame, UVec2, Vec3};
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::unit::lab::verify::chi_square;
use std::f32::consts::TAU;

const COSINES: [f32; 8] = [-0.95, -0.5, 0.0, 0.1, 0.5, 0.8, 0.95, 0.995];
const WO: Vec3 = Vec3::new(0.48, -0.6, 0.64);

fn bsdf(mean_cosine: f32) -> Bsdf {
    Bsdf::Phase(Phase { mean_cosine })
}

/// Cumulative distribution of the cosine between the directions of light, in double precision.
fn below(g: f64, cos: f64) -> f64 {
    if g.abs() < 1e-6 {
        return 0.5 * (1.0 + cos);
    }
    let root = (1.0 + g * g - 2.0 * g * cos).sqrt();
    (1.0 - g * g) / (2.0 * g) * (1.0 / root - 1.0 / (1.0 + g))
}

#[test]
fn phase_chi_square() {
    const CELLS: usize = 200;
    for (i, g) in COSINES.into_iter().enumerate() {
        // At its own alpha and at a larger one.
        for alpha in [1.0 - g.abs(), (1.5 * (1.0 - g.abs())).min(1.0)] {
            let at = f64::from((1.0 - alpha) * g.signum());
            let source = Independent {
                seed: Seed(i as u64),
            };
            let mut stream = source.stream(UVec2::new(alpha.to_bits(), 0), 0);
            let n = 200_000;
            let mut counts = vec![0u32; CELLS];
            let frame = Frame::from_normal(-WO);
            for _ in 0..n {
                let u = std::array::from_fn(|_| stream.next_1d());
                let sample = bsdf(g).sample(alpha, WO, u).unwrap();
                assert!((sample.wi.length() - 1.0).abs() < 1e-5);
                let local = frame.to_local(sample.wi).as_dvec3();
                let rank = below(at, local.z.clamp(-1.0, 1.0)).clamp(0.0, 0.999_999);
                let turn = 0.5 + local.y.atan2(local.x) / f64::from(2.0 * TAU) * 2.0;
                let turn = turn.clamp(0.0, 0.999_999);
                counts[(rank * 20.0) as usize * 10 + (turn * 10.0) as usize] += 1;
            }
            let expected = vec![f64::from(n) / CELLS as f64; CELLS];
            let p = chi_square::p_value(&counts, &expected);
            assert!(p > 1e-4, "g {g}, alpha {alpha}: p = {p}");
        }
    }
}

/// The density integrates to 1, has mean cosine g, and is the derivative of the cumulative distribution.
#[test]
fn phase_normalisation_and_mean_cosine() {
    for g in COSINES {
        let alpha = 1.0 - g.abs();
        let side = WO.any_orthonormal_vector().as_dvec3();
        let way = -WO.as_dvec3();
        let n = 4000;
        let (mut sum, mut mean) = (0.0, 0.0);
        for i in 0..n {
            // Quantiles at even steps resolve peaks.
            let rank = (f64::from(i) + 0.5) / f64::from(n);
            let (mut low, mut high) = (-1.0f64, 1.0f64);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if below(f64::from(g), middle) < rank {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let cos = 0.5 * (low + high);
            let wi = way * cos + side * (1.0 - cos * cos).max(0.0).sqrt();
            let pdf = bsdf(g).pdf(alpha, WO, wi.as_vec3());
            let g = f64::from(g);
            let slope = (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cos).powf(1.5) / 2.0;
            sum += f64::from(pdf) * f64::from(TAU) / slope / f64::from(n);
            mean += cos / f64::from(n);
        }
        assert!((sum - 1.0).abs() < 2e-3, "g {g}: {sum}");
        assert!((mean - f64::from(g)).abs() < 1e-2, "g {g}: {mean}");
    }
}
