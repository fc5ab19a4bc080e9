//! Roughness of a path, class of a path, and accumulated roughness of its last vertex.

use crate::Attenuation;

/// Q: number of roughness bins.
pub const BINS: usize = 4;

/// Number of vertices of the longest path with a class of its own; longer paths are folded `[OPSR (14)]`.
pub const MAX_VERTICES: usize = 5;

/// Lower edges of bins 1, 2 and 3: solutions α of (2^√α − 1)(Q + 1) = 1, 2, 3, rounded to the nearest single.
/// Comparisons with constants give the same bin on every platform; `exp2` and `sqrt` might not.
pub const BIN_EDGES: [f32; 3] = [0.069_187_1, 0.235_639_2, 0.459_781_5];

/// Index of the first class of each path length n = 2..=5.
const OFFSETS: [u16; 4] = [0, 16, 80, 336];

/// Roughness bin of `alpha`, 0..[`BINS`]: min(⌊(2^√α − 1)(Q + 1)⌋, Q − 1) `[OPSR §4.4]`.
#[inline]
pub fn bin(alpha: f32) -> usize {
    BIN_EDGES
        .iter()
        .map(|&edge| usize::from(alpha >= edge))
        .sum()
}

/// Bin of `alpha` before rounding down, clamped to [0, Q − 1]: the coordinate in which the linear look-up interpolates.
#[inline]
pub fn bin_coordinate(alpha: f32) -> f32 {
    if alpha >= BIN_EDGES[2] {
        // Clamped by the same comparison as `bin`.
        (BINS - 1) as f32
    } else {
        ((alpha.sqrt().exp2() - 1.0) * (BINS + 1) as f32).clamp(0.0, (BINS - 1) as f32)
    }
}

/// Class of a path: index of its attenuation factor.
///
/// Classes are ordered by length (2, 3, 4, 5 vertices), then by the base-4 code of the bins of the vertices, with the
/// vertex nearest the camera as the most significant digit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GammaIndex(u16);

impl GammaIndex {
    /// Class of a path by the bins of its vertices, camera first. `None` unless there are 2 to 5, each below [`BINS`].
    pub fn from_bins(bins: &[usize]) -> Option<Self> {
        if !(2..=MAX_VERTICES).contains(&bins.len()) || bins.iter().any(|&bin| bin >= BINS) {
            return None;
        }
        let code = bins.iter().fold(0, |code, &bin| code * BINS + bin);
        Some(Self(OFFSETS[bins.len() - 2] + code as u16))
    }

    /// Class with this index in the table; `None` from 1360 on.
    pub fn new(index: usize) -> Option<Self> {
        (index < crate::LEN).then_some(Self(index as u16))
    }

    /// Index in the table, 0..1360.
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// Bins of the vertices, camera first.
    pub fn bins(self) -> Vec<usize> {
        let length = 2 + OFFSETS[1..].iter().filter(|&&o| self.0 >= o).count();
        let code = usize::from(self.0 - OFFSETS[length - 2]);
        (0..length)
            .rev()
            .map(|i| code / BINS.pow(i as u32) % BINS)
            .collect()
    }

    /// Class of the path without the vertex nearest the camera; `None` for two vertices.
    pub fn suffix(self) -> Option<Self> {
        Self::from_bins(&self.bins()[1..])
    }

    /// Class of a path from the number of vertices before its last one, their base-4 code, and the bin of the last.
    #[inline]
    pub(super) fn compose(prefix_vertices: usize, prefix_code: u16, last: usize) -> Self {
        Self(OFFSETS[prefix_vertices - 1] + prefix_code * BINS as u16 + last as u16)
    }
}

/// Roughness α₁ … αₙ₋₁ of the vertices before the last one, folded to at most four values `[OPSR (5), (14)]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathRoughness {
    alpha: [f32; MAX_VERTICES - 1],
    /// Base-4 code of the bins of `alpha`.
    code: u16,
    len: u8,
}

impl PathRoughness {
    /// Path of these vertices, camera first.
    #[inline]
    pub fn of<A: Attenuation + ?Sized>(alphas: &[f32], attenuation: &A) -> Self {
        let mut path = Self::default();
        for &alpha in alphas {
            path.push(alpha, attenuation, 1.0);
        }
        path
    }

    /// Roughness values after folding, camera first; at most four.
    #[inline]
    pub fn values(&self) -> &[f32] {
        &self.alpha[..usize::from(self.len)]
    }

    /// True if the next vertex folds the path. A folded value depends on the factors; unfolded paths do not.
    #[inline]
    pub fn is_full(&self) -> bool {
        usize::from(self.len) == MAX_VERTICES - 1
    }

    /// Class of the path with a last vertex of roughness `last`; `None` if the prefix is empty.
    #[inline]
    pub fn class(&self, last: f32) -> Option<GammaIndex> {
        (self.len > 0).then(|| GammaIndex::compose(usize::from(self.len), self.code, bin(last)))
    }

    /// Accumulated roughness of a last vertex of roughness `last`:
    ///
    /// ```text
    /// α′ = 1 − (1 − αₙ) ∏ᵢ₌₁ⁿ⁻¹ (1 − γ αᵢ)                              [OPSR (13)]
    /// ```
    ///
    /// with the surplus α′ − αₙ multiplied by `shrink` in [0, 1]. (13) is printed with α_k and k − 1 factors; it is read
    /// as (11) with n = k − 1. Computed as αₙ + (1 − αₙ) q with q ← q + γ αᵢ (1 − q), which subtracts nothing from
    /// numbers near 1: α′ of (0, …, 0, v) is exactly v, and small roughness keeps its digits.
    #[inline]
    pub fn accumulate<A: Attenuation + ?Sized>(
        &self,
        last: f32,
        attenuation: &A,
        shrink: f32,
    ) -> f32 {
        if self.len == 0 || last >= 1.0 {
            return last;
        }
        let gamma = attenuation.gamma(self, last);
        let q = self
            .values()
            .iter()
            .fold(0.0f32, |q, &a| q + gamma * a * (1.0 - q));
        // Rounding could make the sum exceed 1 by one bit.
        (last + (1.0 - last) * q * shrink).min(1.0)
    }

    /// Appends a vertex of roughness `alpha`. The fifth one folds all five into the single value α′₅ `[OPSR (14)]`.
    #[inline]
    pub fn push<A: Attenuation + ?Sized>(&mut self, alpha: f32, attenuation: &A, shrink: f32) {
        debug_assert!(
            (0.0..=1.0).contains(&alpha),
            "roughness {alpha} outside [0, 1]"
        );
        if self.is_full() {
            let folded = self.accumulate(alpha, attenuation, shrink);
            *self = Self::default();
            self.append(folded);
        } else {
            self.append(alpha);
        }
    }

    #[inline]
    fn append(&mut self, alpha: f32) {
        self.alpha[usize::from(self.len)] = alpha;
        self.code = self.code * BINS as u16 + bin(alpha) as u16;
        self.len += 1;
    }
}

#[cfg(test)]
mod tests;
