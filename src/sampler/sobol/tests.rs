use super::*;

/// Points of a set, digits as fractions of 2³².
fn points(key: u64, set: u32, n: u32) -> Vec<Digits> {
    let point = |i| SobolPoint::new(key, i).point(set).0;
    (0..n).map(point).collect()
}

#[test]
fn elementary_intervals_of_every_number_and_pair_hold_one_point() {
    for (key, set) in [(1, 0), (2, 1), (3, 7)] {
        let points = points(key, set, 4096);
        for m in [0u32, 1, 4, 5, 8, 10, 12] {
            for run in points.chunks(1 << m) {
                for a in 0..=m {
                    // Columns of width 2^-a and rows of height 2^-(m - a).
                    let cell = |x: u32, y: u32| {
                        let column = u64::from(x) << a >> 32;
                        let row = u64::from(y) << (m - a) >> 32;
                        (column << (m - a) | row) as usize
                    };
                    let mut seen = vec![[false; 4]; 1 << m];
                    for p in run {
                        seen[cell(p[0], p[1])][0] = true;
                        // The third and fourth number are stratified in one dimension each.
                        seen[cell(p[2], p[2]) >> (m - a)][1] = true;
                        seen[cell(p[3], p[3]) >> (m - a)][2] = true;
                    }
                    let count = |i: usize| seen.iter().filter(|s| s[i]).count();
                    assert_eq!(count(0), 1 << m, "{key} {set} {m} {a}");
                    assert_eq!((count(1), count(2)), (1 << a, 1 << a), "{m} {a}");
                }
            }
        }
    }
}

/// χ² of counts over equal cells in units of its standard deviation.
fn deviation(counts: &[u32]) -> f64 {
    let n: u32 = counts.iter().sum();
    let expected = f64::from(n) / counts.len() as f64;
    let far = |&c: &u32| (f64::from(c) - expected).powi(2) / expected;
    let freedom = (counts.len() - 1) as f64;
    (counts.iter().map(far).sum::<f64>() - freedom) / (2.0 * freedom).sqrt()
}

/// Over all keys, each number of a sample is uniform, and so are pairs of its numbers, within a set and across sets.
#[test]
fn chi_square_of_one_sample_over_sequences() {
    for index in [0, 1, 5, 200, 77_000] {
        let numbers = |key: u64| -> Vec<u32> {
            let sequence = SobolPoint::new(mix(key), index);
            let sets = (0..3).map(|set| sequence.point(set).0);
            sets.flat_map(|p| p.map(|x| x >> 28)).collect()
        };
        let mut pairs = vec![[0u32; 256]; 12 * 12];
        for key in 0..40_000 {
            let numbers = numbers(key);
            for (i, x) in numbers.iter().enumerate() {
                for (j, y) in numbers[..i].iter().enumerate() {
                    pairs[12 * i + j][(x << 4 | y) as usize] += 1;
                }
            }
        }
        for i in 0..12 {
            for j in 0..i {
                let far = deviation(&pairs[12 * i + j]);
                assert!(far < 5.5, "numbers {i} and {j} of sample {index}: {far}");
            }
        }
    }
}

/// Pairs of numbers of different sets are almost independent over the samples of one sequence.
#[test]
fn chi_square_of_pairs_across_sets_over_samples() {
    let (n, runs) = (256, 200);
    let mut counts = vec![[0u32; 256]; 16];
    for key in 0..runs {
        let key = mix(key);
        let (a, b) = (points(key, 1, n), points(key, 2, n));
        for (p, q) in a.iter().zip(&b) {
            for d in 0..16 {
                let cell = p[d / 4] >> 28 << 4 | q[d % 4] >> 28;
                counts[d][cell as usize] += 1;
            }
        }
    }
    for (d, counts) in counts.iter().enumerate() {
        // Each number alone is stratified, so that counts vary less than those of independent numbers.
        assert!(deviation(counts) < 4.0, "{d}: {}", deviation(counts));
    }
}

/// Pictures of a seed must never change.
#[test]
fn determinism_of_points() {
    let bits = SobolPoint::new(7, 5).point(3).0;
    let expected = [0x6518_90ae, 0xa097_2a4d, 0x3f36_8f7e, 0x1402_4938];
    assert_eq!(bits, expected, "{bits:#010x?}");
}
