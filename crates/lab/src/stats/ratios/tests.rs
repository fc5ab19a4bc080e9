use super::*;

/// Normal deviates as sums of twelve uniform ones: accurate to three standard deviations.
fn normal(rng: &mut Pcg32) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn coverage(seeds: usize, spread: f64) -> f64 {
    const TRIALS: usize = 400;
    let mut rng = Pcg32::seed_from_u64(seeds as u64);
    let held = (0..TRIALS).filter(|_| {
        let ours: Vec<f64> = (0..seeds)
            .map(|_| 0.7 * (spread * normal(&mut rng)).exp())
            .collect();
        paired_ratio(&ours, &vec![1.0; seeds]).is_some_and(|i| i.holds(0.7))
    });
    held.count() as f64 / TRIALS as f64
}

#[test]
fn bootstrap_intervals_have_their_coverage() {
    for (seeds, spread) in [(5, 0.02), (5, 0.8), (10, 0.3), (30, 0.3)] {
        let c = coverage(seeds, spread);
        assert!(
            (0.915..0.985).contains(&c),
            "{seeds} seeds, spread {spread}: {c}"
        );
    }
}

#[test]
fn verdicts_tie_for_equal_errors_and_too_few_seeds() {
    let errors = [0.3, 0.2, 0.25, 0.4, 0.31];
    let same = paired_ratio(&errors, &errors).unwrap();
    assert_eq!((same.low, same.value, same.high), (1.0, 1.0, 1.0));
    assert_eq!(Verdict::of(&same, 5), Verdict::Tie);
    let half = errors.map(|e| 0.5 * e);
    let ratio = paired_ratio(&half, &errors).unwrap();
    assert!((ratio.value - 0.5).abs() < 1e-12);
    assert_eq!(Verdict::of(&ratio, 5), Verdict::Better);
    let ratio = paired_ratio(&half[..4], &errors[..4]).unwrap();
    assert_eq!(Verdict::of(&ratio, 4), Verdict::TooFewSeeds);
    assert!(paired_ratio(&[1.0], &[0.0]).is_none() && paired_ratio(&[], &[]).is_none());
}

#[test]
fn squared_bias_is_separated_from_noise() {
    // Pictures of 4000 pixels with noise of 0.1, and a bias of 2 % or none.
    for (bias, seed) in [(0.02, 1), (0.02, 2), (0.0, 3), (0.0, 4)] {
        let mut rng = Pcg32::seed_from_u64(seed);
        let errors: Vec<Vec<f64>> = (0..8)
            .map(|_| (0..4000).map(|_| bias + 0.1 * normal(&mut rng)).collect())
            .collect();
        let product = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>() / a.len() as f64
        };
        let products: Vec<Vec<f64>> = errors
            .iter()
            .map(|a| errors.iter().map(|b| product(a, b)).collect())
            .collect();
        let found = squared_bias(&products, 0.0).unwrap();
        assert!(found.holds(bias * bias), "{bias}: {found:?}");
        assert_eq!(found.low > 0.0, bias > 0.0, "{bias}: {found:?}");
    }
}
