//! Relative errors of pixels: the terms of the error that a render [states](crate::resolve::Statement::mean).

/// ε of relMSE and MAPE: added to the squared radiance, or to the radiance, of the reference.
pub const EPSILON: f64 = 0.01;

/// 3ε of [`relative_errors`]: a tenth of the mean radiance, from the channel sums `light` of all pixels. It makes these
/// errors independent of the exposure.
pub fn floor(light: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = light.fold((0.0, 0u64), |(s, n), x| (s + x.max(0.0), n + 1));
    sum / (30 * count.max(1)) as f64
}

/// Relative errors min(1, Σ|I − f| / (Σf + 3ε)) of pixels, from `light` Σf and absolute `errors` Σ|I − f|. Sums are
/// over red, green and blue.
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

/// Mean of numbers; 0 if there are none.
pub fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u64), |(s, n), x| (s + x, n + 1));
    sum / count.max(1) as f64
}
