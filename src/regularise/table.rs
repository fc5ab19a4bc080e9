//! The table of attenuation factors and its two look-ups.

use super::roughness::{GammaIndex, LEVELS, PathRoughness, bin_coordinate};
use super::{Attenuation, MAX_VERTICES};

/// P: attenuation factors in a table, 4² + 4³ + 4⁴ + 4⁵.
pub const LEN: usize = 1360;

/// How a path finds its factor.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    clap::ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum Lookup {
    /// The factor of the path's class: the paper's text. α′ jumps where a roughness crosses a level.
    #[default]
    Nearest,
    /// Multilinear between neighbouring classes: continuous in every roughness.
    Linear,
}

/// Attenuation factors γ in [0, 1], one for each class of path.
#[derive(Clone, Debug, PartialEq)]
pub struct AttenuationTable {
    /// The factors, in class order (see [`GammaIndex`]), before `scale`.
    pub gammas: Box<[f32; LEN]>,
    /// How they are looked up.
    pub lookup: Lookup,
    /// Multiplies every factor; the product is clamped to 1. The pattern of a table transfers between scenes better
    /// than its level does, so the level can be set for a scene.
    pub scale: f32,
}

impl AttenuationTable {
    /// A table with the same factor everywhere.
    pub fn constant(gamma: f32) -> Self {
        Self {
            gammas: Box::new([gamma; LEN]),
            lookup: Lookup::Nearest,
            scale: 1.0,
        }
    }

    /// The table with a weaker pattern: every factor to the power of `contrast` about the geometric mean of all. 1
    /// changes nothing, 0 makes a constant of it.
    pub fn with_contrast(&self, contrast: f32) -> Self {
        let logs = || {
            self.gammas
                .iter()
                .map(|g| f64::from(g.max(f32::MIN_POSITIVE)).ln())
        };
        let mean = logs().sum::<f64>() / LEN as f64;
        let mut table = self.clone();
        if contrast != 1.0 {
            for (gamma, ln) in table.gammas.iter_mut().zip(logs()) {
                *gamma = (mean + f64::from(contrast) * (ln - mean)).exp() as f32;
            }
        }
        table
    }

    /// The factor of a class, with the scale.
    #[inline]
    pub fn factor(&self, class: GammaIndex) -> f32 {
        (self.gammas[class.index()] * self.scale).min(1.0)
    }

    /// The table entries that a path depends on and their weights: one for the nearest look-up, up to 2ⁿ for the
    /// linear one. The prefix is not empty.
    pub fn entries(
        &self,
        prefix: &PathRoughness,
        last: f32,
        mut visit: impl FnMut(GammaIndex, f32),
    ) {
        match self.lookup {
            Lookup::Nearest => {
                if let Some(class) = prefix.class(last) {
                    visit(class, 1.0);
                }
            }
            Lookup::Linear => linear(prefix, last, visit),
        }
    }
}

impl Attenuation for AttenuationTable {
    #[inline]
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32 {
        match self.lookup {
            Lookup::Nearest => prefix.class(last).map_or(0.0, |class| self.factor(class)),
            Lookup::Linear => {
                let mut gamma = 0.0;
                linear(prefix, last, |class, weight| {
                    gamma += weight * self.gammas[class.index()]
                });
                (gamma * self.scale).min(1.0)
            }
        }
    }
}

/// Corners of the cell that holds the path's level coordinates, with their multilinear weights.
#[inline]
fn linear(prefix: &PathRoughness, last: f32, mut visit: impl FnMut(GammaIndex, f32)) {
    let values = prefix.values();
    let vertices = values.len() + 1;
    let mut below = [0usize; MAX_VERTICES];
    let mut fraction = [0.0f32; MAX_VERTICES];
    for (i, &alpha) in values.iter().chain(std::iter::once(&last)).enumerate() {
        let c = bin_coordinate(alpha);
        below[i] = (c as usize).min(LEVELS - 1);
        fraction[i] = c - below[i] as f32;
    }
    'corner: for corner in 0..1usize << vertices {
        let (mut code, mut weight) = (0u16, 1.0f32);
        for i in 0..vertices {
            let up = corner >> i & 1;
            weight *= if up == 1 {
                fraction[i]
            } else {
                1.0 - fraction[i]
            };
            if weight == 0.0 {
                continue 'corner;
            }
            if i + 1 < vertices {
                code = code * LEVELS as u16 + (below[i] + up) as u16;
            } else {
                visit(
                    GammaIndex::compose(vertices - 1, code, below[i] + up),
                    weight,
                );
            }
        }
    }
}

impl<A: Attenuation + ?Sized> Attenuation for &A {
    #[inline]
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32 {
        (**self).gamma(prefix, last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regularise::bin;

    /// The share of the vertex at place `i` of a path in a factor that grows linearly with every level.
    fn share(i: usize) -> f32 {
        [0.05, 0.02, 0.03, 0.01, 0.04][i]
    }

    fn paths() -> Vec<Vec<f32>> {
        let some = [0.0, 0.01, 0.069, 0.07, 0.15, 0.3, 0.45, 0.46, 0.8, 1.0];
        let path = |n: usize, k: usize| (0..n).map(|i| some[(k * (i + 3) + i * i) % 10]).collect();
        (2..=MAX_VERTICES)
            .flat_map(|n| (0..40).map(move |k| path(n, k)))
            .collect()
    }

    #[test]
    fn contrast_is_about_the_geometric_mean() {
        let mut table = AttenuationTable::constant(0.1);
        for (gamma, k) in table.gammas.iter_mut().zip(0i32..) {
            *gamma *= 4f32.powi(k % 2 * 2 - 1);
        }
        table.scale = 3.0;
        assert_eq!(table.with_contrast(1.0), table);
        for (contrast, step) in [(0.5, 2.0), (0.0, 1.0)] {
            let weaker = table.with_contrast(contrast);
            assert_eq!((weaker.scale, weaker.lookup), (table.scale, table.lookup));
            for pair in weaker.gammas.chunks_exact(2) {
                assert!((pair[0] * step - 0.1).abs() < 1e-6 && (pair[1] / step - 0.1).abs() < 1e-6);
            }
        }
        // A factor of 0 stays finite.
        table.gammas[7] = 0.0;
        let flat = table.with_contrast(0.0);
        assert!(flat.gammas.iter().all(|g| *g > 0.0 && *g < 0.1));
    }

    #[test]
    fn either_lookup_of_factors_that_grow_with_the_levels() {
        let mut table = AttenuationTable::constant(0.0);
        for (i, gamma) in table.gammas.iter_mut().enumerate() {
            let levels = GammaIndex::new(i).unwrap().levels();
            let parts = levels.iter().enumerate().map(|(i, &l)| share(i) * l as f32);
            *gamma = 0.1 + parts.sum::<f32>();
        }
        for scale in [1.0, 0.5, 3.0] {
            table.scale = scale;
            for path in paths() {
                let (last, before) = path.split_last().unwrap();
                let prefix = PathRoughness::of(before, &table);
                let factor = |level: &dyn Fn(f32) -> f32| {
                    let parts = path.iter().enumerate().map(|(i, &a)| share(i) * level(a));
                    ((0.1 + parts.sum::<f32>()) * scale).min(1.0)
                };
                let nearest = factor(&|a| bin(a) as f32);
                // A multilinear look-up gives linear functions back.
                let linear = factor(&bin_coordinate);
                for (lookup, expected) in [(Lookup::Nearest, nearest), (Lookup::Linear, linear)] {
                    table.lookup = lookup;
                    let gamma = table.gamma(&prefix, *last);
                    assert!(
                        (gamma - expected).abs() < 1e-6,
                        "{lookup:?} {path:?}: {gamma} {expected}"
                    );
                    let (mut sum, mut all) = (0.0, 0.0);
                    table.entries(&prefix, *last, |class, weight| {
                        assert!(weight > 0.0 && class.levels().len() == path.len());
                        sum += weight * table.gammas[class.index()];
                        all += weight;
                    });
                    assert!((all - 1.0f32).abs() < 1e-6, "{lookup:?} {path:?}: {all}");
                    assert!(((sum * scale).min(1.0) - expected).abs() < 1e-6);
                }
            }
        }
    }
}
