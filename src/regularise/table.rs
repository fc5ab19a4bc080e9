//! The table of attenuation factors and its two look-ups.

use super::roughness::{GammaIndex, LEVELS, PathRoughness, bin_coordinate};
use super::{Attenuation, MAX_VERTICES};

/// P: attenuation factors in a table, 4² + 4³ + 4⁴ + 4⁵.
pub const LEN: usize = 1360;

/// How a path finds its factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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
