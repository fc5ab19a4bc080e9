//! Accumulated roughness α′ with its derivatives with respect to the table's entries.

use opsr::regularise::{AttenuationTable, ConstantGamma, GammaIndex, MAX_VERTICES, PathRoughness};

/// Sparse gradient: dα′/dγ for each table entry that α′ depends on.
pub type Dependence = Vec<(GammaIndex, f32)>;

/// α′ of the path `alphas` (original roughness of every vertex, camera first, any length), as [`PathRoughness`]
/// computes it, and its derivative with respect to each table entry (before the table's scale).
///
/// For n ≤ 5, with γ the factor of the class:
///
/// ```text
/// dα′/dγ = (1 − αₙ) Σᵢ αᵢ ∏_{l ≠ i, l < n} (1 − γ α_l)
/// ```
///
/// accumulated without a division as q′ ← q′ (1 − γ αᵢ) + αᵢ (1 − q), so that γ = αᵢ = 1 is no special case. The chain
/// rule carries the derivatives of a folded value α′₅ on; the *bin* of the folded value is taken as constant.
#[cfg(test)]
pub(crate) fn accumulate_with_gradient(
    alphas: &[f32],
    table: &AttenuationTable,
) -> (f32, Dependence) {
    let Some((&last, before)) = alphas.split_last() else {
        return (0.0, Dependence::new());
    };
    let mut path = Differentiated::default();
    for &alpha in before {
        path.push(alpha, table);
    }
    let mut dependence = Dependence::new();
    let alpha = path.accumulate(last, table, &mut dependence);
    (alpha, dependence)
}

/// Vertices before the last, as [`PathRoughness`] folds them, with the derivatives of the folded value.
#[derive(Debug, Default)]
pub struct Differentiated {
    prefix: PathRoughness,
    /// Derivatives of the folded value, which is the first value of the prefix.
    folded: Dependence,
    /// Derivatives of the previous folded value; kept to reuse its memory.
    before: Dependence,
}

impl Clone for Differentiated {
    fn clone(&self) -> Self {
        Self {
            prefix: self.prefix,
            folded: self.folded.clone(),
            before: Dependence::new(),
        }
    }

    /// Copies into the memory of `self`: states are copied at every vertex of every path.
    fn clone_from(&mut self, other: &Self) {
        self.prefix = other.prefix;
        self.folded.clone_from(&other.folded);
    }
}

impl Differentiated {
    /// Appends a vertex.
    pub fn push(&mut self, alpha: f32, table: &AttenuationTable) {
        if self.prefix.values().len() == MAX_VERTICES - 1 {
            std::mem::swap(&mut self.folded, &mut self.before);
            self.folded.clear();
            gradient(&self.prefix, alpha, table, &self.before, &mut self.folded);
        }
        self.prefix.push(alpha, table, 1.0);
    }

    /// α′ of a last vertex of roughness `last`; appends its derivatives to `to`.
    pub fn accumulate(&self, last: f32, table: &AttenuationTable, to: &mut Dependence) -> f32 {
        gradient(&self.prefix, last, table, &self.folded, to);
        self.prefix.accumulate(last, table, 1.0)
    }
}

/// α′ of a path of at most five vertices with the attenuation factor `gamma`, and dα′/dγ.
pub(crate) fn accumulate_at(alphas: &[f32], gamma: f32) -> (f32, f32) {
    debug_assert!(alphas.len() <= MAX_VERTICES);
    let Some((&last, before)) = alphas.split_last() else {
        return (0.0, 0.0);
    };
    let constant = ConstantGamma(gamma);
    let prefix = PathRoughness::of(before, &constant);
    let alpha = prefix.accumulate(last, &constant, 1.0);
    let derivative = if last >= 1.0 {
        0.0
    } else {
        (1.0 - last) * surplus_derivative(&prefix, gamma)
    };
    (alpha, derivative)
}

/// d/dγ of 1 − ∏ (1 − γ αᵢ).
fn surplus_derivative(prefix: &PathRoughness, gamma: f32) -> f32 {
    let (mut q, mut dq) = (0.0f32, 0.0f32);
    for &a in prefix.values() {
        dq = dq * (1.0 - gamma * a) + a * (1.0 - q);
        q += gamma * a * (1.0 - q);
    }
    dq
}

/// Appends the derivatives of `prefix.accumulate(last)` to `to`; `folded` holds the derivatives of the prefix's first value.
fn gradient(
    prefix: &PathRoughness,
    last: f32,
    table: &AttenuationTable,
    folded: &Dependence,
    to: &mut Dependence,
) {
    if prefix.values().is_empty() || last >= 1.0 {
        return;
    }
    let start = to.len();
    let mut raw = 0.0f32;
    table.entries(prefix, last, |class, weight| {
        raw += weight * table.gammas[class.index()]
    });
    let gamma = (raw * table.scale).min(1.0);
    let dq = surplus_derivative(prefix, gamma);
    // A factor clamped to 1 does not depend on the entries.
    let derivative = if raw * table.scale > 1.0 {
        0.0
    } else {
        (1.0 - last) * dq * table.scale
    };
    if derivative != 0.0 {
        table.entries(prefix, last, |class, weight| {
            add(to, start, class, derivative * weight)
        });
    }
    // dα′/dα₁ = (1 − αₙ) γ ∏_{i ≥ 2} (1 − γ αᵢ), if the first value is a folded one.
    if !folded.is_empty() {
        let inner = (1.0 - last)
            * gamma
            * prefix.values()[1..]
                .iter()
                .map(|&a| 1.0 - gamma * a)
                .product::<f32>();
        for &(class, d) in folded {
            add(to, start, class, inner * d);
        }
    }
}

/// Adds `d` to the entry of `class` among the entries from `start` on.
fn add(to: &mut Dependence, start: usize, class: GammaIndex, d: f32) {
    match to[start..].iter_mut().find(|(c, _)| *c == class) {
        Some((_, sum)) => *sum += d,
        None => to.push((class, d)),
    }
}

#[cfg(test)]
mod tests {
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
                    let alphas: Vec<f64> =
                        (0..n).map(|_| f64::from(next().powi(2) as f32)).collect();
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
}
