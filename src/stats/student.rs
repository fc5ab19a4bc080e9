//! Student's t distribution: the probability of a deviation in units of a standard error from the same few samples.
//!
//! Degrees of freedom may be any positive number, infinity included.

use libm::lgamma;

/// Probability of a |t| at least this large with `degrees` > 0 of freedom.
///
/// P = I_x(ν/2, ½) with x = ν / (ν + t²), the regularised incomplete beta function.
pub(crate) fn two_sided(t: f64, degrees: f64) -> f64 {
    // Beyond, the distribution is the normal one to five digits, and the continued fraction gets long.
    let nu = degrees.clamp(0.5, 1e5);
    if !t.is_finite() {
        return 0.0;
    }
    let t2 = t * t;
    let (a, b) = (0.5 * nu, 0.5);
    let (x, y) = (nu / (nu + t2), t2 / (nu + t2));
    if y == 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() + b * y.ln() + lgamma(a + b) - lgamma(a) - lgamma(b)).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * fraction(a, b, x) / a
    } else {
        1.0 - front * fraction(b, a, y) / b
    }
}

/// The t > 0 that |t| exceeds with this `probability`.
pub(crate) fn quantile(probability: f64, degrees: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while two_sided(high, degrees) > probability && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if two_sided(middle, degrees) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Continued fraction of the incomplete beta function, by Lentz's method.
fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let safe = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let mut c = 1.0;
    let mut d = safe(1.0 - (a + b) * x / (a + 1.0)).recip();
    let mut value = d;
    for m in 1..2000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut step = 1.0;
        for term in [even, odd] {
            d = safe(1.0 + term * d).recip();
            c = safe(1.0 + term / c);
            step = c * d;
            value *= step;
        }
        if (step - 1.0).abs() < 1e-14 {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_distribution_has_the_values_of_the_tables() {
        // The 5 % points of every table of the distribution.
        for (nu, t) in [
            (1.0, 12.7062),
            (2.0, 4.30265),
            (10.0, 2.22814),
            (100.0, 1.98397),
            (1e9, 1.95996),
        ] {
            assert!(
                (two_sided(t, nu) - 0.05).abs() < 5e-6,
                "ν = {nu}: {}",
                two_sided(t, nu)
            );
            assert!((quantile(0.05, nu) / t - 1.0).abs() < 1e-4, "ν = {nu}");
        }
        for t in [0.0f64, 1e-9, 0.3, 1.0, 5.0, 1e3] {
            // ν = 1 is Cauchy's distribution, ν = 2 has a root for its integral.
            let cauchy = 1.0 - 2.0 / std::f64::consts::PI * t.atan();
            assert!((two_sided(t, 1.0) - cauchy).abs() < 1e-9, "t = {t}");
            assert!(
                (two_sided(t, 2.0) - (1.0 - t / (2.0 + t * t).sqrt())).abs() < 1e-9,
                "t = {t}"
            );
        }
        assert_eq!(two_sided(f64::INFINITY, 3.0), 0.0);
        assert!(two_sided(40.0, 1e5) < 1e-300);
    }
}
