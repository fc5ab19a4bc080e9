//! Discrete distributions: an alias table in one dimension, inverted cumulative sums in two.

use super::{DVec2, Vec2};

/// Draws one of n outcomes with given probabilities in constant time: Vose's alias method.
#[derive(Clone, Debug, Default)]
pub(crate) struct AliasTable {
    /// For each column, the probability of its own outcome, and the outcome drawn otherwise.
    columns: Vec<(f32, u32)>,
    pmf: Vec<f32>,
}

impl AliasTable {
    /// Table of outcomes 0..n with probabilities proportional to `weights`, which are finite and at least 0. Empty if
    /// no weight is positive.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let sum: f64 = weights.iter().sum();
        if sum.is_nan() || sum <= 0.0 || sum.is_infinite() {
            return Self::default();
        }
        let n = weights.len();
        let mut scaled: Vec<f64> = weights.iter().map(|w| w / sum * n as f64).collect();
        let mut columns: Vec<(f32, u32)> = (0..n).map(|i| (1.0, i as u32)).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..n).partition(|&i| scaled[i] < 1.0);
        while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
            columns[s] = (scaled[s] as f32, l as u32);
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // Rounding may leave probability on the column of an outcome without weight, which must never be drawn.
        for (i, column) in columns.iter_mut().enumerate() {
            if weights[i] == 0.0 {
                column.0 = 0.0;
            }
        }
        let heaviest = (0..n)
            .max_by(|&a, &b| weights[a].total_cmp(&weights[b]))
            .unwrap_or(0);
        for (i, column) in columns.iter_mut().enumerate() {
            if weights[i] == 0.0 && column.1 == i as u32 {
                column.1 = heaviest as u32;
            }
        }
        Self {
            columns,
            pmf: weights.iter().map(|w| (w / sum) as f32).collect(),
        }
    }

    /// True if no outcome can be drawn.
    pub(crate) fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Probability of outcome `i` < n.
    #[inline]
    pub(crate) fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }

    /// Maps `u` in [0, 1) to an outcome and the remainder of `u`, rescaled to be uniform in [0, 1) again; `None` if the
    /// table is empty.
    ///
    /// `u` has double precision since it supplies the column and the remainder: n outcomes leave 53 − log₂ n of its
    /// bits for the choice within the column. Single precision would leave 7 bits among 1e5 outcomes.
    #[inline]
    pub(crate) fn sample(&self, u: f64) -> Option<(usize, f64)> {
        let n = self.columns.len();
        let x = u * n as f64;
        let i = (x as usize).min(n.checked_sub(1)?);
        let rest = (x - i as f64).clamp(0.0, ALMOST_ONE);
        let (keep, other) = self.columns[i];
        let keep = f64::from(keep);
        Some(if rest < keep {
            (i, (rest / keep).min(ALMOST_ONE))
        } else {
            (
                other as usize,
                ((rest - keep) / (1.0 - keep)).min(ALMOST_ONE),
            )
        })
    }
}

/// Largest double-precision number below 1.
pub(crate) const ALMOST_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Probabilities of the cells of a grid: the marginal of the rows, then a row's conditional, each by inversion of its
/// cumulative sums.
#[derive(Clone, Debug)]
pub(crate) struct Distribution2D {
    width: usize,
    /// Cumulative probability at the end of each row.
    rows: Vec<f32>,
    /// Cumulative probability inside each row, at the end of each column.
    columns: Vec<f32>,
}

impl Distribution2D {
    /// Probabilities proportional to `weights`, listed row by row with `width` columns, finite and at least 0. `None`
    /// if no weight is positive or the last row is incomplete.
    pub(crate) fn new(width: usize, weights: &[f64]) -> Option<Self> {
        if width == 0 || weights.is_empty() || !weights.len().is_multiple_of(width) {
            return None;
        }
        let mut sums = Vec::new();
        let mut columns = Vec::with_capacity(weights.len());
        for row in weights.chunks_exact(width) {
            columns.extend(cumulative(row));
            sums.push(row.iter().sum());
        }
        let total: f64 = sums.iter().sum();
        (total > 0.0 && total.is_finite()).then(|| Self {
            width,
            rows: cumulative(&sums),
            columns,
        })
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.columns[y * self.width..][..self.width]
    }

    /// Maps `u` in [0, 1)² to a cell (column, row), a uniform position in it in [0, 1)², and the cell's probability.
    ///
    /// Each coordinate gives a cell and the position in it: 24 bits are too few if a sun has all but 1e-6 of the
    /// probability. A cell after the sun whose probability the rounding of the sums loses has probability 0.
    #[inline]
    pub(crate) fn sample(&self, u: DVec2) -> ([usize; 2], Vec2, f32) {
        let (y, v, mass_y) = invert(&self.rows, u.y);
        let (x, h, mass_x) = invert(self.row(y), u.x);
        ([x, y], Vec2::new(h, v), mass_x * mass_y)
    }

    /// Probability of a cell (column, row).
    #[inline]
    pub(crate) fn pmf(&self, [x, y]: [usize; 2]) -> f32 {
        mass(self.row(y), x) * mass(&self.rows, y)
    }
}

/// Cumulative sums divided by the total; all zero if the total is zero.
fn cumulative(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    let mut out: Vec<f32> = weights
        .iter()
        .map(|w| {
            sum += w;
            if total > 0.0 {
                (sum / total) as f32
            } else {
                0.0
            }
        })
        .collect();
    // Rounding must not leave the sum below 1 at the last cell that has weight.
    if let Some(last) = weights.iter().rposition(|&w| w > 0.0) {
        out[last..].fill(1.0);
    }
    out
}

/// Probability of cell `i` of a cumulative sum.
#[inline]
fn mass(cumulative: &[f32], i: usize) -> f32 {
    cumulative[i] - if i > 0 { cumulative[i - 1] } else { 0.0 }
}

/// Index of the cell that contains `u`, position of `u` in it in [0, 1), and its probability as in [`mass`].
#[inline]
fn invert(cumulative: &[f32], u: f64) -> (usize, f32, f32) {
    let i = cumulative
        .partition_point(|&c| f64::from(c) <= u)
        .min(cumulative.len() - 1);
    let below = if i > 0 { cumulative[i - 1] } else { 0.0 };
    let p = cumulative[i] - below;
    let inside = if p > 0.0 {
        (((u - f64::from(below)) / f64::from(p)) as f32).clamp(0.0, 1.0 - f32::EPSILON / 2.0)
    } else {
        0.5
    };
    (i, inside, p)
}

#[cfg(test)]
pub(crate) mod tests;
