//! Pearson's chi-square test of counts, and quadrature of densities for the expected counts.

use super::Finding;
use statrs::function::gamma::gamma_ur;

/// Least expected count of a cell. Cells with less are pooled, because their statistic is not chi-square distributed.
const MIN_EXPECTED: f64 = 10.0;

/// Probability that a chi-square variable with `freedom` degrees of freedom exceeds `x`: the regularised upper incomplete
/// gamma function Q(freedom/2, x/2). `freedom` is at least 1.
pub(crate) fn upper_tail(x: f64, freedom: usize) -> f64 {
    match x > 0.0 {
        true => gamma_ur(0.5 * freedom as f64, 0.5 * x),
        false => 1.0,
    }
}

/// Probability of counts at least as far from `expected` as `observed`; both have the same sum up to rounding.
pub fn p_value(observed: &[u32], expected: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut statistic, mut cells) = (0.0, 0usize);
    let (mut o, mut e) = (0.0, 0.0);
    for &i in &order {
        o += f64::from(observed[i]);
        e += expected[i];
        if e >= MIN_EXPECTED {
            statistic += (o - e) * (o - e) / e;
            cells += 1;
            (o, e) = (0.0, 0.0);
        }
    }
    if cells < 2 {
        return 1.0;
    }
    upper_tail(statistic, cells - 1)
}

/// Largest −log₁₀ of named p-values. Its bound is −log₁₀ of 0.01 over their number (Bonferroni's correction).
pub fn finding(tried: &str, p_values: &[(f64, String)]) -> Finding {
    // A p-value that underflows to 0 keeps a finite logarithm.
    let negative_log = |p: f64| -p.max(1e-300).log10();
    let bound = negative_log(0.01 / p_values.len() as f64);
    let worst = p_values.iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let (count, name) = (p_values.len(), worst.map_or("", |(_, name)| name));
    Finding::new(
        format!("{tried}, {count} tests, −log10 p; {name}"),
        bound,
        p_values.iter().map(|&(p, _)| negative_log(p)),
    )
}

/// ∫∫ f over a rectangle by 3 × 3 Gauss points, subdivided until two levels agree to `tolerance`. A rectangle with a
/// zero of f may contain an edge between the points: it is subdivided at least twice.
pub fn integrate(f: &impl Fn(f64, f64) -> f64, x: [f64; 2], y: [f64; 2], tolerance: f64) -> f64 {
    refine(f, [x, y], gauss(f, x, y).0, tolerance, DEPTH)
}

/// Most levels of subdivision.
const DEPTH: u32 = 6;

fn refine(
    f: &impl Fn(f64, f64) -> f64,
    [x, y]: [[f64; 2]; 2],
    coarse: f64,
    tolerance: f64,
    depth: u32,
) -> f64 {
    let (mx, my) = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
    let parts = [
        [[x[0], mx], [y[0], my]],
        [[mx, x[1]], [y[0], my]],
        [[x[0], mx], [my, y[1]]],
        [[mx, x[1]], [my, y[1]]],
    ];
    let values = parts.map(|[x, y]| gauss(f, x, y));
    let fine: f64 = values.iter().map(|v| v.0).sum();
    let edge = depth > DEPTH - 2 && values.iter().any(|v| v.1);
    if depth == 0 || (!edge && (fine - coarse).abs() < tolerance) {
        return fine;
    }
    parts
        .into_iter()
        .zip(values)
        .map(|(part, value)| refine(f, part, value.0, 0.5 * tolerance, depth - 1))
        .sum()
}

/// Integral by nine points; true if f is zero at one of them.
fn gauss(f: &impl Fn(f64, f64) -> f64, x: [f64; 2], y: [f64; 2]) -> (f64, bool) {
    let node = 0.6f64.sqrt();
    let rule = [(-node, 5.0 / 18.0), (0.0, 8.0 / 18.0), (node, 5.0 / 18.0)];
    let at = |r: [f64; 2], t: f64| 0.5 * (r[0] + r[1] + t * (r[1] - r[0]));
    let (mut sum, mut zero) = (0.0, false);
    for (tx, wx) in rule {
        for (ty, wy) in rule {
            let value = f(at(x, tx), at(y, ty));
            sum += wx * wy * value;
            zero |= value == 0.0;
        }
    }
    (sum * (x[1] - x[0]) * (y[1] - y[0]), zero)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_upper_tail_matches_tables() {
        for (x, freedom, p) in [
            (3.841_458_821, 1, 0.05),
            (5.991_464_547, 2, 0.05),
            (124.342_113_4, 100, 0.05),
            (149.449_252_8, 100, 0.001),
            (7.814_727_903, 3, 0.05),
            (1_074.679_449, 1000, 0.05),
        ] {
            let found = upper_tail(x, freedom);
            assert!((found / p - 1.0).abs() < 1e-6, "{x} {freedom}: {found}");
        }
    }

    #[test]
    fn quadrature_across_an_edge() {
        let disk = integrate(
            &|x, y| f64::from(x * x + y * y < 1.0),
            [-1.0, 1.0],
            [-1.0, 1.0],
            1e-5,
        );
        assert!((disk - std::f64::consts::PI).abs() < 5e-3, "{disk}");
        let gauss = integrate(
            &|x, y| (-x * x - y * y).exp(),
            [-6.0, 6.0],
            [-6.0, 6.0],
            1e-8,
        );
        assert!((gauss - std::f64::consts::PI).abs() < 1e-6, "{gauss}");
    }
}
