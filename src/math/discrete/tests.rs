use super::*;
use crate::math::UVec2;
use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};

#[test]
fn alias_table_draws_outcomes_with_their_pmf() {
    let weights = [0.1, 0.0, 5.0, 1e-3, 2.0, 0.0];
    let table = AliasTable::new(&weights);
    let n = 1_000_000;
    let mut counts = [0u32; 6];
    let mut rest_sum = 0.0;
    for k in 0..n {
        let (i, rest) = table.sample((f64::from(k) + 0.5) / f64::from(n)).unwrap();
        assert!((0.0..1.0).contains(&rest));
        rest_sum += rest;
        counts[i] += 1;
    }
    let total: f64 = weights.iter().sum();
    for (i, &c) in counts.iter().enumerate() {
        let p = weights[i] / total;
        assert!(
            (f64::from(c) / f64::from(n) - p).abs() < 2e-5,
            "{i}: {c} {p}"
        );
        assert!(weights[i] > 0.0 || c == 0);
    }
    assert!((rest_sum / f64::from(n) - 0.5).abs() < 1e-3);
    assert!(AliasTable::new(&[0.0, 0.0]).is_empty());
    assert!(AliasTable::new(&[]).sample(0.5).is_none());
}

#[test]
fn distribution_2d_pmf_sums_to_one_and_matches_sample() {
    let weights = [0.0, 1.0, 1e5, 0.0, 3.0, 0.5, 0.0, 0.0, 0.0, 2.0, 0.0, 7.0];
    let d = Distribution2D::new(4, &weights).unwrap();
    let sum: f64 = (0..12).map(|i| f64::from(d.pmf([i % 4, i / 4]))).sum();
    assert!((sum - 1.0).abs() < 1e-6);
    for k in 0..100_000u32 {
        let k = f64::from(k);
        let u = DVec2::new((k * 0.618_034).fract(), (k + 0.5) / 100_000.0);
        let (cell, inside, pmf) = d.sample(u);
        assert!(inside.min_element() >= 0.0 && inside.max_element() < 1.0);
        assert!(pmf > 0.0 && d.pmf(cell) == pmf, "{cell:?} {pmf}");
    }
    assert!(Distribution2D::new(4, &[0.0; 8]).is_none());
}

/// Excess of a chi-square statistic in standard deviations of a normal variable, by Wilson and Hilferty (1931): above
/// 2.33 in 1 % of all tests. Neighbouring cells are pooled to expected counts of at least 10.
pub(crate) fn excess(counts: &[u32], expected: &[f64]) -> f64 {
    let (mut square, mut cells, mut pool) = (0.0, 0u32, (0.0, 0.0));
    for (&count, expected) in counts.iter().zip(expected) {
        pool = (pool.0 + f64::from(count), pool.1 + expected);
        if pool.1 >= 10.0 {
            square += (pool.0 - pool.1) * (pool.0 - pool.1) / pool.1;
            cells += 1;
            pool = (0.0, 0.0);
        }
    }
    let degrees = f64::from(cells - 1);
    let spread = 2.0 / (9.0 * degrees);
    ((square / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()
}

fn stream(seed: u64) -> IndependentStream {
    Independent { seed: Seed(seed) }.stream(UVec2::ZERO, 0)
}

#[test]
fn chi_square_of_alias_tables_of_many_skewed_outcomes() {
    // One lamp a thousand times as strong as all others together; powers over six decades.
    let beside_a_lamp = |n: usize| {
        let dim = move |i| if i == 0 { 1e3 } else { 1.0 / n as f64 };
        (0..n).map(dim).collect::<Vec<f64>>()
    };
    let mut u = stream(1);
    let spread: Vec<f64> = (0..1_000_000)
        .map(|_| 10f64.powf(-6.0 * f64::from(u.next_1d())))
        .collect();
    let mut found = Vec::new();
    for (name, weights) in [
        ("lamp and 1e5", beside_a_lamp(100_000)),
        ("lamp and 1e6", beside_a_lamp(1_000_000)),
        ("six decades", spread),
    ] {
        let table = AliasTable::new(&weights);
        let draws = 10_000_000;
        let mut counts = vec![0u32; weights.len()];
        for _ in 0..draws {
            let (i, _) = table.sample(u.vertex().light.pick).unwrap();
            counts[i] += 1;
        }
        let total: f64 = weights.iter().sum();
        let expected: Vec<f64> = weights
            .iter()
            .map(|w| w / total * f64::from(draws))
            .collect();
        found.push((excess(&counts, &expected), name.to_owned()));
        // All dim outcomes together.
        let dim: u32 = counts[1..].iter().sum();
        let pooled = [counts[0], dim];
        let expected = [expected[0], expected[1..].iter().sum()];
        if expected[0] > 10.0 {
            found.push((excess(&pooled, &expected), format!("{name}, pooled")));
        }
    }
    assert!(found.iter().all(|(excess, _)| *excess < 3.0), "{found:?}");
}

#[test]
fn chi_square_of_dim_texels_beside_a_sun() {
    // A row of an 8k map: 4096 texels that have a billionth of the sun's probability each, then the sun.
    const N: usize = 8192;
    let weights: Vec<f64> = (0..N).map(|x| if x == N / 2 { 1e9 } else { 1.0 }).collect();
    let map = Distribution2D::new(N, &weights).unwrap();
    let (dim, draws) = (N / 2, 1_000_000);
    let below = dim as f64 / (1e9 + N as f64 - 1.0);
    let mut counts = vec![0u32; dim];
    let mut u = stream(2);
    for _ in 0..draws {
        let ([x, _], _, pmf) = map.sample(DVec2::new(u.vertex().light.pick * below, 0.5));
        // Rounding of the sums may let the last draws fall on the sun.
        if let Some(count) = counts.get_mut(x) {
            *count += 1;
            assert!((pmf * 1e9 - 1.0).abs() < 1e-3, "{pmf}");
        }
    }
    let expected = vec![f64::from(draws) / dim as f64; dim];
    let excess = excess(&counts, &expected);
    assert!(excess < 2.33, "{excess}");
}
