//! Table of attenuation factors, its tuning for a scene, and its two look-ups.

use crate::roughness::{BINS, GammaIndex, PathRoughness, bin_coordinate};
use crate::{Attenuation, MAX_VERTICES};

/// P: number of attenuation factors in a table, 4² + 4³ + 4⁴ + 4⁵.
pub const LEN: usize = 1360;

/// Look-up of the factor of a path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Lookup {
    /// Factor of the path's class, as in the paper. α′ jumps where a roughness crosses the edge of a bin.
    #[default]
    Nearest,
    /// Multilinear interpolation between neighbouring classes: continuous in every roughness.
    Linear,
}

/// Attenuation factors γ in [0, 1], one for each class of path, ready to be looked up.
#[derive(Clone, Debug, PartialEq)]
pub struct AttenuationTable {
    /// Factors in class order (see [`GammaIndex`]), before the scale.
    pub gammas: Box<[f32; LEN]>,
    /// Map from a path to its factor.
    pub lookup: Lookup,
    /// Multiplier of every factor, above 0; the product is clamped to 1.
    pub scale: f32,
}

impl AttenuationTable {
    /// Table of these factors in [0, 1], in class order.
    pub fn new(gammas: Box<[f32; LEN]>, lookup: Lookup, scale: f32) -> Self {
        Self {
            gammas,
            lookup,
            scale,
        }
    }

    /// Table with the same factor for all paths.
    pub fn constant(gamma: f32) -> Self {
        Self::new(Box::new([gamma; LEN]), Lookup::Nearest, 1.0)
    }

    /// Factor of a class, scale included.
    #[inline]
    pub fn factor(&self, class: GammaIndex) -> f32 {
        (self.gammas[class.index()] * self.scale).min(1.0)
    }

    /// Visits the table entries that a path depends on with their weights, which sum to 1: one entry for the nearest
    /// look-up, up to 2ⁿ for the linear one. The prefix is not empty.
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

    /// Factor of a path before the scale.
    #[inline]
    pub fn unscaled(&self, prefix: &PathRoughness, last: f32) -> f32 {
        match self.lookup {
            Lookup::Nearest => (prefix.class(last)).map_or(0.0, |class| self.gammas[class.index()]),
            Lookup::Linear => {
                let mut gamma = 0.0;
                linear(prefix, last, |class, weight| {
                    gamma += weight * self.gammas[class.index()]
                });
                gamma
            }
        }
    }
}

impl Attenuation for AttenuationTable {
    #[inline]
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32 {
        (self.unscaled(prefix, last) * self.scale).min(1.0)
    }
}

/// Visits the classes at the corners of the cell that holds the path's bin coordinates, with their multilinear weights.
#[inline]
fn linear(prefix: &PathRoughness, last: f32, mut visit: impl FnMut(GammaIndex, f32)) {
    let values = prefix.values();
    let vertices = values.len() + 1;
    let mut below = [0usize; MAX_VERTICES];
    let mut fraction = [0.0f32; MAX_VERTICES];
    for (i, &alpha) in values.iter().chain(std::iter::once(&last)).enumerate() {
        let c = bin_coordinate(alpha);
        below[i] = (c as usize).min(BINS - 1);
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
                code = code * BINS as u16 + (below[i] + up) as u16;
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
    use crate::bin;

    /// Coefficient of vertex `i` of a path in a factor that is linear in every bin.
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
    fn nearest_and_linear_lookup_reproduce_a_linear_table() {
        let mut table = AttenuationTable::constant(0.0);
        for (i, gamma) in table.gammas.iter_mut().enumerate() {
            let bins = GammaIndex::new(i).unwrap().bins();
            let parts = bins.iter().enumerate().map(|(i, &b)| share(i) * b as f32);
            *gamma = 0.1 + parts.sum::<f32>();
        }
        for scale in [1.0, 0.5, 3.0] {
            table.scale = scale;
            for path in paths() {
                let (last, before) = path.split_last().unwrap();
                let prefix = PathRoughness::of(before, &table);
                let factor = |bin: &dyn Fn(f32) -> f32| {
                    let parts = path.iter().enumerate().map(|(i, &a)| share(i) * bin(a));
                    ((0.1 + parts.sum::<f32>()) * scale).min(1.0)
                };
                let nearest = factor(&|a| bin(a) as f32);
                // Multilinear interpolation reproduces linear functions.
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
                        assert!(weight > 0.0 && class.bins().len() == path.len());
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
