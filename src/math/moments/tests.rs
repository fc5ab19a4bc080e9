use super::*;

fn samples() -> Vec<DVec3> {
    // Fixed irregular sequence: fractional parts of multiples of irrational numbers.
    (0..5000)
        .map(|i| {
            let t = f64::from(i);
            DVec3::new(
                1e3 + 0.1 * (t * 0.618_033_988_75).fract(),
                (t * 0.414_213_562_37).fract().powi(8),
                -(t * 0.732_050_807_57).fract(),
            )
        })
        .collect()
}

fn of(samples: &[DVec3]) -> Moments {
    let mut m = Moments::default();
    samples.iter().for_each(|&x| m.push(x));
    m
}

fn two_pass(samples: &[DVec3]) -> (DVec3, DVec3) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<DVec3>() / n;
    let m2 = samples
        .iter()
        .map(|&x| (x - mean) * (x - mean))
        .sum::<DVec3>();
    (mean, m2 / (n - 1.0))
}

#[test]
fn variance_of_a_small_deviation_at_a_large_mean() {
    let samples = samples();
    let (mean, variance) = two_pass(&samples);
    let m = of(&samples);
    assert!(((m.mean - mean) / mean).abs().max_element() < 1e-13);
    assert!(
        ((m.sample_variance() - variance) / variance)
            .abs()
            .max_element()
            < 1e-9
    );
    assert!((m.sample_variance().x.sqrt() - 0.1 / 12f64.sqrt()).abs() < 1e-4);
}

#[test]
fn merge_equals_pushing_all_samples() {
    let samples = samples();
    let whole = of(&samples);
    for cut in [0, 1, 2, 1234, 4999, 5000] {
        let mut left = of(&samples[..cut]);
        left.merge(&of(&samples[cut..]));
        assert_eq!(left.n, whole.n);
        assert!(((left.mean - whole.mean) / whole.mean).abs().max_element() < 1e-12);
        let error = (left.sample_variance() - whole.sample_variance()) / whole.sample_variance();
        assert!(error.abs().max_element() < 1e-9, "cut at {cut}: {error}");
    }
}

#[test]
fn variance_is_never_negative() {
    let mut m = Moments::default();
    for i in 0..100_000 {
        // The samples differ in the last bit, which a sum of squares would lose at this magnitude.
        m.push(DVec3::splat(if i % 2 == 0 { 1e8 } else { 1e8 + 1.5e-8 }));
        assert!(m.m2().min_element() >= 0.0);
    }
    let constant = of(&[DVec3::splat(0.1); 1000]);
    assert_eq!(constant.sample_variance(), DVec3::ZERO);
}
