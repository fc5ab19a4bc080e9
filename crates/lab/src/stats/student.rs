//! Student's t distribution: the probability of a deviation in units of a standard error estimated from few samples.
//!
//! Degrees of freedom may be any positive number, infinity included.

use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::beta::checked_beta_reg;

/// Range of the degrees of freedom. Above, the distribution is the normal one to five digits.
const MIN_FREEDOM: f64 = 0.5;
const MAX_FREEDOM: f64 = 1e5;

/// Probability of a |t| at least this large with `degrees` > 0 of freedom.
///
/// P = I_x(ν/2, ½) with x = ν / (ν + t²), the regularised incomplete beta function.
pub(crate) fn two_sided(t: f64, degrees: f64) -> f64 {
    let nu = degrees.clamp(MIN_FREEDOM, MAX_FREEDOM);
    if !t.is_finite() {
        return 0.0;
    }
    let t2 = t * t;
    checked_beta_reg(0.5 * nu, 0.5, nu / (nu + t2)).unwrap_or(f64::NAN)
}

/// The t > 0 that |t| exceeds with this `probability`.
pub(crate) fn quantile(probability: f64, degrees: f64) -> f64 {
    let nu = degrees.clamp(MIN_FREEDOM, MAX_FREEDOM);
    StudentsT::new(0.0, 1.0, nu).map_or(f64::NAN, |t| -t.inverse_cdf(0.5 * probability))
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
            // ν = 1 is Cauchy's distribution, and ν = 2 has an algebraic integral.
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
