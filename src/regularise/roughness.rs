//! The roughness of a path, its class, and the accumulated roughness of its last vertex.

use super::Attenuation;

/// Q: roughness levels a class tells apart.
pub const BINS: usize = 4;

/// Vertices of the longest path with a class of its own; longer ones are folded `[OPSR (14)]`.
pub const MAX_VERTICES: usize = 5;

/// Roughness at which levels 1, 2 and 3 begin: solutions of (2^√α − 1)(Q + 1) = 1, 2, 3, rounded to the nearest
/// single. Comparisons with constants give the same level on every platform, `exp2` and `sqrt` might not.
pub const BIN_EDGES: [f32; 3] = [0.069_187_1, 0.235_639_2, 0.459_781_5];

/// First class of each path length n = 2..=5.
const OFFSETS: [u16; 4] = [0, 16, 80, 336];

/// Roughness level of `alpha`: min(⌊(2^√α − 1)(Q + 1)⌋, Q − 1) `[OPSR §4.4]`.
#[inline]
pub fn bin(alpha: f32) -> usize {
    BIN_EDGES
        .iter()
        .map(|&edge| usize::from(alpha >= edge))
        .sum()
}

/// The level before rounding down, clamped to [0, Q − 1]: what the linear look-up interpolates.
#[inline]
pub fn bin_coordinate(alpha: f32) -> f32 {
    if alpha >= BIN_EDGES[2] {
        // The clamp, decided by the same comparison as `bin`.
        (BINS - 1) as f32
    } else {
        ((alpha.sqrt().exp2() - 1.0) * (BINS + 1) as f32).clamp(0.0, (BINS - 1) as f32)
    }
}

/// A class of path: index of its attenuation factor.
///
/// Classes are ordered by length (2, 3, 4, 5 vertices); inside a length by the base-4 code of the levels, the vertex
/// nearest the camera being the most significant digit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GammaIndex(u16);

impl GammaIndex {
    /// The class of the given levels, camera first; 2 to 5 of them, each below [`BINS`].
    pub fn from_bins(levels: &[usize]) -> Option<Self> {
        if !(2..=MAX_VERTICES).contains(&levels.len()) || levels.iter().any(|&l| l >= BINS) {
            return None;
        }
        let code = levels.iter().fold(0, |code, &l| code * BINS + l);
        Some(Self(OFFSETS[levels.len() - 2] + code as u16))
    }

    /// The class with this index in the table.
    pub fn new(index: usize) -> Option<Self> {
        (index < super::LEN).then_some(Self(index as u16))
    }

    /// Index in the table, 0..1360.
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// The levels, camera first.
    pub fn bins(self) -> Vec<usize> {
        let length = 2 + OFFSETS[1..].iter().filter(|&&o| self.0 >= o).count();
        let code = usize::from(self.0 - OFFSETS[length - 2]);
        (0..length)
            .rev()
            .map(|i| code / BINS.pow(i as u32) % BINS)
            .collect()
    }

    /// The class without the vertex nearest the camera; `None` for two vertices.
    pub fn suffix(self) -> Option<Self> {
        Self::from_bins(&self.bins()[1..])
    }

    /// The class of a folded prefix of `n - 1` vertices and their code, and a last vertex on `level`.
    #[inline]
    pub(super) fn compose(prefix_vertices: usize, prefix_code: u16, level: usize) -> Self {
        Self(OFFSETS[prefix_vertices - 1] + prefix_code * BINS as u16 + level as u16)
    }
}

/// Roughness α₁ … αₙ₋₁ of the vertices before the last, folded so that at most four values remain `[OPSR (5), (14)]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathRoughness {
    alpha: [f32; MAX_VERTICES - 1],
    /// Base-4 code of the levels of `alpha`.
    code: u16,
    len: u8,
}

impl PathRoughness {
    /// The path of these vertices, camera first.
    #[inline]
    pub fn of<A: Attenuation + ?Sized>(alphas: &[f32], attenuation: &A) -> Self {
        let mut path = Self::default();
        for &alpha in alphas {
            path.push(alpha, attenuation, 1.0);
        }
        path
    }

    /// The values that remain after folding, camera first.
    #[inline]
    pub fn values(&self) -> &[f32] {
        &self.alpha[..usize::from(self.len)]
    }

    /// The class of the path that ends with a vertex of roughness `last`; `None` where the prefix is empty.
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
    /// times `shrink` in the surplus α′ − αₙ. Deviates: (13) is printed with α_k and k−1 factors; it is read as (11)
    /// with n = k−1. Computed as αₙ + (1 − αₙ) q, q ← q + γ αᵢ (1 − q): nothing is subtracted from numbers near 1,
    /// so g(0, …, 0, v) = v to the bit and tiny roughness keeps its digits.
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
        // Rounding could lift the sum one bit above 1.
        (last + (1.0 - last) * q * shrink).min(1.0)
    }

    /// Appends a vertex. The fifth folds all of them into the one value α′₅ `[OPSR (14)]`.
    #[inline]
    pub fn push<A: Attenuation + ?Sized>(&mut self, alpha: f32, attenuation: &A, shrink: f32) {
        debug_assert!(
            (0.0..=1.0).contains(&alpha),
            "roughness {alpha} outside [0, 1]"
        );
        if usize::from(self.len) == MAX_VERTICES - 1 {
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
mod tests {
    use super::*;

    #[test]
    fn edges_are_where_the_formula_puts_them() {
        for (k, &edge) in BIN_EDGES.iter().enumerate() {
            let exact = (1.0 + (k as f64 + 1.0) / 5.0).log2().powi(2);
            assert_eq!(edge, exact as f32, "edge {k}: {exact}");
            assert_eq!([bin(edge.next_down()), bin(edge)], [k, k + 1]);
        }
    }

    #[test]
    fn classes_are_1360_and_distinct() {
        let mut seen = vec![false; super::super::LEN];
        for n in 2..=5usize {
            for code in 0..4usize.pow(n as u32) {
                let levels: Vec<_> = (0..n)
                    .rev()
                    .map(|i| code / 4usize.pow(i as u32) % 4)
                    .collect();
                let class = GammaIndex::from_bins(&levels).unwrap();
                assert_eq!(class.bins(), levels);
                assert_eq!(class.suffix(), GammaIndex::from_bins(&levels[1..]));
                assert_eq!(class.suffix().is_some(), n > 2);
                assert!(!std::mem::replace(&mut seen[class.index()], true));
            }
        }
        assert!(seen.iter().all(|&s| s));
    }

    #[test]
    fn the_class_of_a_path_has_the_levels_of_its_vertices() {
        let factor = crate::regularise::ConstantGamma(0.5);
        let path = [0.8, 0.0, 0.3, 0.1, 0.5];
        for n in 1..=5 {
            let (last, before) = path[..n].split_last().unwrap();
            let levels: Vec<_> = path[..n].iter().map(|&a| bin(a)).collect();
            let prefix = PathRoughness::of(before, &factor);
            assert_eq!(prefix.class(*last), GammaIndex::from_bins(&levels));
        }
    }

    /// The fifth vertex folds what there is as far as this sample roughens.
    #[test]
    fn a_folded_path_is_one_vertex_of_the_roughness_in_use() {
        let factor = crate::regularise::ConstantGamma(0.5);
        for shrink in [1.0, 0.25, 0.0] {
            let mut path = PathRoughness::default();
            for alpha in [0.2, 0.4, 0.0, 1.0] {
                path.push(alpha, &factor, shrink);
            }
            // 1 − 0.9 · 0.8 · 1 · 0.5 = 0.64.
            let folded = 0.1 + 0.9 * 0.64 * shrink;
            assert!((path.accumulate(0.1, &factor, shrink) - folded).abs() < 1e-6);
            path.push(0.1, &factor, shrink);
            assert_eq!(path.values().len(), 1);
            assert!((path.values()[0] - folded).abs() < 1e-6, "{shrink}");
            assert_eq!(path.class(0.0), GammaIndex::from_bins(&[bin(folded), 0]));
        }
    }
}
