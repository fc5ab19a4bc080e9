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

/// Appends the derivatives of `prefix.accumulate(last)` to `to`; `folded` holds those of the prefix's first value.
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
mod tests;
