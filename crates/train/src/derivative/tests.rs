use super::*;
use opsr::regularise::Lookup;

/// α′ in double precision by its recursive definition.
fn definition(alphas: &[f64], gammas: &[f64], lookup: Lookup) -> f64 {
    let (first, rest) = if alphas.len() > 5 {
        (definition(&alphas[..5], gammas, lookup), &alphas[5..])
    } else {
        (alphas[0], &alphas[1..])
    };
    let folded: Vec<f64> = std::iter::once(first).chain(rest.iter().copied()).collect();
    if alphas.len() > 5 && folded.len() > 5 {
        return definition(&folded, gammas, lookup);
    }
    let (last, before) = folded.split_last().unwrap();
    if before.is_empty() {
        return *last;
    }
    let single: Vec<f32> = before.iter().map(|&a| a as f32).collect();
    let prefix = PathRoughness::of(&single, &AttenuationTable::constant(0.0));
    let table = AttenuationTable {
        lookup,
        ..AttenuationTable::constant(0.0)
    };
    let mut gamma = 0.0;
    table.entries(&prefix, *last as f32, |c, w| {
        gamma += f64::from(w) * gammas[c.index()]
    });
    1.0 - (1.0 - last) * before.iter().map(|a| 1.0 - gamma * a).product::<f64>()
}

#[test]
fn accumulate_at_matches_a_constant_table() {
    let lists: [&[f32]; 6] = [
        &[],
        &[0.3],
        &[0.5, 1.0],
        &[1.0, 0.0],
        &[0.2, 0.9, 0.05],
        &[1.0, 0.0, 0.31, 0.7, 0.1],
    ];
    for list in lists {
        for gamma in [1e-3, 0.2, 0.77, 1.0] {
            let (alpha, gradient) =
                accumulate_with_gradient(list, &AttenuationTable::constant(gamma));
            let sum: f32 = gradient.iter().map(|(_, d)| d).sum();
            assert_eq!(accumulate_at(list, gamma), (alpha, sum), "{list:?} {gamma}");
        }
    }
}

#[test]
fn gradient_matches_finite_differences() {
    let mut state = 1u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1u64 << 24) as f64
    };
    let direction = |i: usize| 0.5 + (i * 29 % 31) as f64 / 31.0;
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        for n in [2usize, 3, 5, 6, 9, 10, 13] {
            for _ in 0..20 {
                let alphas: Vec<f64> = (0..n).map(|_| f64::from(next().powi(2) as f32)).collect();
                let gammas: Vec<f64> = (0..opsr::regularise::LEN)
                    .map(|_| f64::from((0.1 + 0.8 * next()) as f32))
                    .collect();
                let mut table = AttenuationTable {
                    lookup,
                    ..AttenuationTable::constant(0.0)
                };
                table
                    .gammas
                    .iter_mut()
                    .zip(&gammas)
                    .for_each(|(t, &g)| *t = g as f32);
                let path: Vec<f32> = alphas.iter().map(|&a| a as f32).collect();
                let (value, gradient) = accumulate_with_gradient(&path, &table);
                assert!((f64::from(value) - definition(&alphas, &gammas, lookup)).abs() < 2e-6);
                let differences = lookup == Lookup::Nearest || n <= 5;
                // Directional derivative over all entries: a missing entry shows.
                let moved = |h: f64| {
                    let g: Vec<f64> = gammas
                        .iter()
                        .enumerate()
                        .map(|(i, g)| g + h * direction(i))
                        .collect();
                    definition(&alphas, &g, lookup)
                };
                let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                let ours: f64 = gradient
                    .iter()
                    .map(|(c, d)| f64::from(*d) * direction(c.index()))
                    .sum();
                assert!(
                    !differences || (numeric - ours).abs() <= 1e-4 * numeric.abs().max(1e-2),
                    "{lookup:?} {n}: {numeric} {ours} along all entries"
                );
                for &(class, d) in &gradient {
                    let shifted = |h: f64| {
                        let mut g = gammas.clone();
                        g[class.index()] += h;
                        definition(&alphas, &g, lookup)
                    };
                    // In the linear look-up the weights too depend on a folded value, which the derivative
                    // leaves out: finite differences agree for the nearest look-up and for paths without a fold.
                    if !differences {
                        continue;
                    }
                    let numeric = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
                    assert!(
                        (numeric - f64::from(d)).abs() <= 1e-4 * numeric.abs().max(1e-2),
                        "{lookup:?} {n}: {numeric} {d}"
                    );
                }
            }
        }
    }
}

#[test]
fn gradient_is_nonzero_at_one_and_zero_where_clamped() {
    for (factor, scale, expected) in [(1.0, 1.0, 0.45), (0.5, 2.0, 0.9), (0.6, 2.0, 0.0)] {
        for lookup in [Lookup::Nearest, Lookup::Linear] {
            let table = AttenuationTable {
                scale,
                lookup,
                ..AttenuationTable::constant(factor)
            };
            let (value, gradient) = accumulate_with_gradient(&[0.5, 0.1], &table);
            assert!((value - 0.55).abs() < 1e-6, "{lookup:?} {value}");
            let total: f32 = gradient.iter().map(|g| g.1).sum();
            assert!(
                (total - expected).abs() < 1e-6,
                "{lookup:?}, {factor} times {scale}: {total}"
            );
        }
    }
}
