//! Accumulated roughness of a path: small values, edges of bins, long paths.

use super::{Finding, Numbers};
use opsr::regularise::{
    Attenuation, AttenuationTable, BIN_EDGES, BINS, ConstantGamma, GammaIndex, LEN, Lookup,
    MAX_VERTICES, PathRoughness, bin,
};

const PATHS: usize = 200_000;

/// α′ of a path, camera first, with a table.
pub type Accumulate<'a> = &'a dyn Fn(&[f32], &AttenuationTable) -> f32;

/// α′ by [`PathRoughness`].
pub fn accumulate(alphas: &[f32], attenuation: &AttenuationTable) -> f32 {
    with(alphas, attenuation)
}

fn with(alphas: &[f32], attenuation: &impl Attenuation) -> f32 {
    let (last, before) = alphas.split_last().expect("paths have a vertex");
    PathRoughness::of(before, attenuation).accumulate(*last, attenuation, 1.0)
}

pub(super) fn all() -> Vec<Finding> {
    vec![
        small_roughness(&accumulate),
        zeros(&accumulate),
        bounds(),
        bins(&bin),
        folding(&accumulate),
        continuity(),
    ]
}

/// A table of random factors.
fn table(lookup: Lookup, numbers: &mut Numbers) -> AttenuationTable {
    let mut table = AttenuationTable {
        lookup,
        ..AttenuationTable::constant(0.0)
    };
    table.gammas.fill_with(|| numbers.next());
    table
}

/// Relative error of α′ for roughness from 1e-8 to 1e-2, where the form 1 − (1 − αₙ) ∏ (1 − γ αᵢ) loses its digits in
/// single precision.
pub fn small_roughness(accumulate: Accumulate<'_>) -> Finding {
    let mut numbers = Numbers::new(1);
    let errors = (0..PATHS).map(|_| {
        let length = 2 + numbers.below(MAX_VERTICES - 1);
        let alphas: Vec<f32> = (0..length)
            .map(|_| numbers.logarithmic(1e-8, 1e-2) as f32)
            .collect();
        let gamma = 0.01 + 0.99 * numbers.next();
        let (last, before) = alphas.split_last().expect("at least two vertices");
        let [last, gamma64] = [*last, gamma].map(f64::from);
        let q = before.iter().fold(0.0, |q, &a| {
            let step = gamma64 * f64::from(a);
            q + step * (1.0 - q)
        });
        let exact = last + (1.0 - last) * q;
        let found = accumulate(&alphas, &AttenuationTable::constant(gamma));
        (f64::from(found) - exact).abs() / exact
    });
    Finding::new(
        "relative error of α′ for roughness 1e-8 to 1e-2",
        1e-6,
        errors,
    )
}

/// Counts paths (0, …, 0, v) whose α′ is not bit-identical to v.
pub fn zeros(accumulate: Accumulate<'_>) -> Finding {
    let mut numbers = Numbers::new(2);
    let table = table(Lookup::Nearest, &mut numbers);
    let errors = (0..PATHS).map(|_| {
        let mut alphas = vec![0.0; numbers.below(12)];
        let last = numbers.logarithmic(1e-38, 1.0) as f32;
        alphas.push(last);
        f64::from(u8::from(
            accumulate(&alphas, &table).to_bits() != last.to_bits(),
        ))
    });
    Finding::new("α′ of (0, …, 0, v) that is not v", 0.0, errors)
}

/// Largest violation of αₙ ≤ α′ ≤ 1, of α′ = αₙ for γ = 0, and of monotonicity in γ and in every roughness.
fn bounds() -> Finding {
    let mut numbers = Numbers::new(3);
    let violations = (0..PATHS).map(|_| {
        let length = 1 + numbers.below(12);
        let mut alpha = || match numbers.below(6) {
            0 => 0.0,
            1 => 1.0,
            2 => numbers.logarithmic(1e-8, 1.0) as f32,
            _ => numbers.next(),
        };
        let mut alphas: Vec<f32> = (0..length).map(|_| alpha()).collect();
        let gamma = numbers.next();
        let last = alphas[length - 1];
        let value = with(&alphas, &ConstantGamma(gamma));
        let mut worst = f64::from(last - value).max(f64::from(value) - 1.0);
        worst = worst.max(f64::from((with(&alphas, &ConstantGamma(0.0)) - last).abs()));
        let larger = gamma + (1.0 - gamma) * numbers.next();
        worst = worst.max(f64::from(value - with(&alphas, &ConstantGamma(larger))));
        let i = numbers.below(length);
        alphas[i] += (1.0 - alphas[i]) * numbers.next();
        worst.max(f64::from(value - with(&alphas, &ConstantGamma(gamma))))
    });
    // Rounding may reverse an increase in the last bits of 1.
    Finding::new(
        "violation of αₙ ≤ α′ ≤ 1, of γ = 0, of monotonicity",
        2.5e-7,
        violations,
    )
}

/// Counts wrong bins of a million roughness values and of the neighbours of each edge, against the formula in double
/// precision.
pub fn bins(bin: &dyn Fn(f32) -> usize) -> Finding {
    let formula = |alpha: f32| {
        let coordinate = (f64::from(alpha).sqrt().exp2() - 1.0) * (BINS + 1) as f64;
        (coordinate as usize).min(BINS - 1)
    };
    let mut numbers = Numbers::new(4);
    let mut wrong = 0;
    for edge in BIN_EDGES {
        // The edge itself is a rounded value and may lie on either side of the exact edge.
        for step in 1..1000 {
            for alpha in [edge.to_bits() - step, edge.to_bits() + step].map(f32::from_bits) {
                wrong += usize::from(bin(alpha) != formula(alpha));
            }
        }
    }
    for _ in 0..1_000_000 {
        let alpha = numbers.next();
        let is_edge = BIN_EDGES.contains(&alpha);
        wrong += usize::from(!is_edge && bin(alpha) != formula(alpha));
    }
    for (alpha, expected) in [
        (0.0, 0),
        (1.0, 3),
        (2.0, 3),
        (f32::INFINITY, 3),
        (f32::NAN, 0),
        (-1.0, 0),
    ] {
        wrong += usize::from(bin(alpha) != expected);
    }
    Finding::new("roughness in a wrong bin", 0.0, [wrong as f64])
}

/// α′ by its recursive definition, camera first `[OPSR (13), (14)]`.
fn definition(alphas: &[f32], table: &AttenuationTable) -> f32 {
    if alphas.len() > MAX_VERTICES {
        let (first, rest) = alphas.split_at(MAX_VERTICES);
        let folded = [definition(first, table)];
        return definition(&[&folded[..], rest].concat(), table);
    }
    let (&last, before) = alphas.split_last().expect("paths have a vertex");
    let bins: Vec<usize> = alphas.iter().map(|&a| bin(a)).collect();
    match GammaIndex::from_bins(&bins) {
        Some(class) if last < 1.0 => {
            let gamma = table.gammas[class.index()];
            let q = before
                .iter()
                .fold(0.0f32, |q, &a| q + gamma * a * (1.0 - q));
            (last + (1.0 - last) * q).min(1.0)
        }
        _ => last,
    }
}

/// Counts paths of 1 to 12, 64 and 1000 vertices whose α′ is not bit-identical to the recursive definition.
pub fn folding(accumulate: Accumulate<'_>) -> Finding {
    let mut numbers = Numbers::new(5);
    let table = table(Lookup::Nearest, &mut numbers);
    let mut wrong = 0;
    for length in (1..=12).chain([64, 1000]) {
        for _ in 0..if length > 12 { 100 } else { 2000 } {
            let alphas: Vec<f32> = (0..length)
                .map(|_| match numbers.below(4) {
                    0 => 0.0,
                    1 => BIN_EDGES[numbers.below(3)],
                    2 => numbers.next() * 0.1,
                    _ => numbers.next(),
                })
                .collect();
            let found = accumulate(&alphas, &table);
            wrong += usize::from(found.to_bits() != definition(&alphas, &table).to_bits());
        }
    }
    Finding::new(
        "paths of 1 to 1000 vertices that differ from (14)",
        0.0,
        [wrong as f64],
    )
}

/// Jump of α′ at a bin's edge with the linear look-up.
fn continuity() -> Finding {
    let mut numbers = Numbers::new(6);
    let table = table(Lookup::Linear, &mut numbers);
    debug_assert_eq!(table.gammas.len(), LEN);
    let jumps = (0..PATHS / 10).map(|_| {
        let length = 2 + numbers.below(MAX_VERTICES - 1);
        let mut alphas: Vec<f32> = (0..length).map(|_| numbers.next()).collect();
        let (i, edge) = (numbers.below(length), BIN_EDGES[numbers.below(3)]);
        alphas[i] = edge;
        let above = accumulate(&alphas, &table);
        alphas[i] = edge.next_down();
        f64::from((above - accumulate(&alphas, &table)).abs())
    });
    Finding::new("jump of α′ across an edge, linear look-up", 5e-6, jumps)
}
