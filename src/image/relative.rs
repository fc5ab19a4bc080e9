//! Errors relative to the light of a pixel: the terms of the number that a render [states](crate::resolve::Statement::mean) of itself.

/// ε of relMSE and MAPE: added to the squared radiance, or to the radiance, of the reference.
pub const EPSILON: f64 = 0.01;

/// 3ε of [`relative_errors`], a tenth of the mean radiance, from the light of all pixels, the channels of each added up. So these errors
/// do not depend on the exposure.
pub fn floor(light: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = light.fold((0.0, 0u64), |(s, n), x| (s + x.max(0.0), n + 1));
    sum / (30 * count.max(1)) as f64
}

/// Relative errors min(1, Σ|I − f| / (Σf + 3ε)) of pixels of this light Σf and these absolute errors Σ|I − f|, where the sums are over
/// red, green and blue.
pub fn relative_errors(
    light: impl Iterator<Item = f64> + Clone,
    errors: impl Iterator<Item = f64>,
) -> impl Iterator<Item = f64> {
    let floor = floor(light.clone());
    light.zip(errors).map(move |(light, error)| match error {
        // Without light and error the quotient is not a number.
        0.0 => 0.0,
        _ => (error / (light.max(0.0) + floor)).min(1.0),
    })
}

/// Mean of numbers, 0 of none.
pub fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u64), |(s, n), x| (s + x, n + 1));
    sum / count.max(1) as f64
}
