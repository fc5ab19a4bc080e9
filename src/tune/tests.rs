use super::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// Tiles of batches that are `mean` plus noise.
fn noisy(rng: &mut Pcg32, mean: f64, noise: f64, tiles: usize) -> Tiles {
    let means = std::array::from_fn(|_| {
        (0..tiles)
            .map(|_| [0, 1, 2].map(|_| mean + noise * (rng.random::<f64>() - 0.5)))
            .collect()
    });
    Tiles {
        means,
        variance: vec![2.0; tiles],
    }
}

#[test]
fn bias2_estimate_is_unbiased() {
    let mut rng = Pcg32::seed_from_u64(3);
    let tiles = 40_000;
    for bias in [0.0, 0.02, 0.1] {
        let plain = noisy(&mut rng, 0.5, 0.4, tiles);
        let candidate = noisy(&mut rng, 0.5 + bias, 0.4, tiles);
        let candidate = (TableTuning::NONE, candidate);
        let found = measure(&plain, &candidate, &vec![1.0; tiles], 10, &[0, 1, 2, 3]);
        // Noise of d is 0.4 / sqrt(6); that of the square of four batches over 3 tiles is below 2e-4.
        let expected: f64 = bias * bias;
        assert!((found.bias2 - expected).abs() < 2e-4, "{bias}: {found:?}");
        assert!((found.variance - 0.2).abs() < 1e-12);
    }
}

#[test]
fn successive_halving_keeps_the_best_and_the_untuned_table() {
    let candidate = |(i, tuning): (usize, TableTuning)| Candidate {
        tuning,
        // The larger the index, the better.
        bias2: -1.0,
        variance: 1.0 / (i + 1) as f64,
        energy: 0.0,
    };
    let candidates: Vec<Candidate> = tunings().enumerate().map(candidate).collect();
    let none = tunings().position(|c| c == TableTuning::NONE).unwrap();
    let last = candidates.len() - SECOND_ROUND..candidates.len();
    let expected: Vec<usize> = std::iter::once(none).chain(last).collect();
    assert_eq!(survivors(&candidates), expected);
}

#[test]
fn energy_limit_goes_before_error() {
    let candidate = |scale: f32, bias2: f64, energy: f64| Candidate {
        tuning: TableTuning {
            contrast: 1.0,
            scale,
        },
        bias2,
        variance: 0.0,
        energy,
    };
    let mut pilot = Pilot {
        tuning: TableTuning::NONE,
        decided: true,
        candidates: vec![
            candidate(1.0, 0.1, -0.2),
            candidate(2.0, 0.2, 0.08),
            candidate(3.0, 0.4, 0.01),
            candidate(4.0, 0.3, -0.02),
        ],
        paths: 0,
    };
    for (share, best) in [
        (1.0, 1.0),
        (0.2, 1.0),
        (0.1, 2.0),
        (0.05, 4.0),
        (0.015, 3.0),
        (0.0, 3.0),
    ] {
        assert_eq!(pilot.within(share).scale, best, "{share}");
    }
    pilot.candidates.clear();
    assert_eq!(pilot.within(0.1), TableTuning::NONE);
}
