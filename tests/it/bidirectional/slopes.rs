//! Rates at which errors fall with the number of iterations: slopes of logarithms. Minutes, and so not for every change:
//!
//! ```sh
//! cargo test --release --test it slopes_long -- --ignored --nocapture
//! ```

use crate::support::render::{film_with, scene};
use opsr::image::Film;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Estimator, Settings};
use opsr::math::{Rgb, Vec3};
use opsr::scene::Scene;
use opsr_lab::gallery;

const SIZE: u32 = 24;
const SEEDS: u64 = 4;

fn settings(estimator: Estimator, seed: u64) -> Settings {
    Settings {
        estimator,
        max_vertices: 8,
        seed,
        ..Settings::default()
    }
}

/// Mean square error of pixels against a picture, over seeds, without the largest hundredth: rare samples, whose rate
/// differs, dominate it.
fn error(films: &[Film], reference: &[Vec3]) -> f64 {
    let mut errors: Vec<f64> = (0..reference.len())
        .map(|i| {
            let of = |film: &Film| {
                let off: Rgb = film.mean().pixels[i] - reference[i];
                f64::from(off.length_squared())
            };
            films.iter().map(of).sum::<f64>() / films.len() as f64
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let kept = errors.len() * 99 / 100;
    errors[..kept].iter().sum::<f64>() / kept as f64
}

/// Slope of the logarithm of the error from the first number of iterations to the last, by least squares.
fn slope(scene: &Scene, estimator: Estimator, iterations: &[u32], reference: &[Vec3]) -> f64 {
    let points: Vec<(f64, f64)> = (iterations.iter())
        .map(|&n| {
            let films: Vec<Film> = (1..=SEEDS)
                .map(|seed| film_with(scene, &settings(estimator, seed), SIZE, n))
                .collect();
            let error = error(&films, reference);
            println!("{estimator:?}, {n}: {error:.3e}");
            (f64::from(n).ln(), error.ln())
        })
        .collect();
    let n = points.len() as f64;
    let (x, y) = (points.iter()).fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let along: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    along / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

fn reference(scene: &Scene, estimator: Estimator, spp: u32) -> Vec<Vec3> {
    film_with(scene, &settings(estimator, 77), SIZE, spp)
        .mean()
        .pixels
}

/// Unbiased estimators have MSE ~ 1/n. With a radius that shrinks with α = 2/3 the variance falls as n^(−2/3) and the
/// bias as n^(−1/3), so both parts of the error fall as n^(−2/3) `[UPS (19)–(23)]`.
#[test]
#[ignore = "long: slopes of errors over thousands of iterations"]
fn slopes_long() {
    let scene = scene(gallery::cornell_box());
    let radius = |first| Radius {
        first: Some(first),
        alpha: 2.0 / 3.0,
    };
    let path = reference(&scene, Estimator::Bdpt, 16384);
    let numbers = [4, 16, 64, 256];
    for (estimator, expected, within) in [
        (Estimator::Path { reuse: false }, -1.0, 0.07),
        (Estimator::Bdpt, -1.0, 0.07),
        // Connections find all light of this scene, and merges contribute hardly anything.
        (Estimator::Vcm(radius(0.1)), -1.0, 0.15),
        // A small radius, where the noise of photons dominates: that of camera paths falls as 1/n at any radius.
        (Estimator::Sppm(radius(0.02)), -2.0 / 3.0, 0.12),
    ] {
        let found = slope(&scene, estimator, &numbers, &path);
        println!("{estimator:?}: slope {found:.3} for {expected:.3}");
        assert!((found - expected).abs() < within, "{estimator:?}: {found}");
    }
}
