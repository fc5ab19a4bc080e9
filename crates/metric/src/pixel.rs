//! Errors of single pixels, averaged over pixels and channels in double precision.

use glam::DVec3;
use serde::Serialize;

use super::{Metric, MetricError, check};
use opsr::image::Buffer;
use opsr::image::relative::{EPSILON, floor, mean_of, relative_errors};

/// The part of the pixels that [`relmse_trimmed`] leaves out.
pub(crate) const TRIMMED: f64 = 0.001;

/// Per-pixel errors, averaged over channels.
fn errors(
    test: &Buffer,
    reference: &Buffer,
    f: impl Fn(DVec3, DVec3) -> DVec3,
) -> Result<Vec<f64>, MetricError> {
    check(test, reference)?;
    let pairs = test.pixels.iter().zip(&reference.pixels);
    Ok(pairs
        .map(|(i, r)| f(i.as_dvec3(), r.as_dvec3()).element_sum() / 3.0)
        .collect())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn squared(i: DVec3, f: DVec3) -> DVec3 {
    (i - f) * (i - f)
}

fn relative_squared(i: DVec3, f: DVec3) -> DVec3 {
    squared(i, f) / (f * f + EPSILON)
}

/// Mean squared error.
pub fn mse(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let value = mean(&errors(test, reference, squared)?);
    Ok(Metric::new("MSE", "mean (I − f)²", &[], value))
}

/// Root of the mean squared error.
pub fn rmse(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let value = mean(&errors(test, reference, squared)?).sqrt();
    Ok(Metric::new("RMSE", "√ mean (I − f)²", &[], value))
}

/// Relative mean squared error.
pub fn relmse(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let value = mean(&errors(test, reference, relative_squared)?);
    Ok(Metric::new(
        "relMSE",
        "mean (I − f)² / (f² + ε)",
        &[("ε", EPSILON)],
        value,
    ))
}

/// [`relmse`] without the worst 0.1 % of the pixels (rounded up), so that a firefly does not dominate.
pub fn relmse_trimmed(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let mut all = errors(test, reference, relative_squared)?;
    all.sort_unstable_by(f64::total_cmp);
    let dropped = (TRIMMED * all.len() as f64).ceil() as usize;
    // A picture of one pixel keeps it.
    let kept = (all.len() - dropped).max(1);
    let constants = [("ε", EPSILON), ("trimmed", TRIMMED)];
    let formula = "relMSE without the worst 0.1 % of pixels";
    Ok(Metric::new(
        "relMSE trimmed",
        formula,
        &constants,
        mean(&all[..kept]),
    ))
}

/// Mean absolute error relative to the reference, the error term of the training objective. [OPSR (16)]
pub fn mape(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let f = |i: DVec3, f: DVec3| (i - f).abs() / (f + EPSILON);
    let value = mean(&errors(test, reference, f)?);
    Ok(Metric::new(
        "MAPE",
        "mean |I − f| / (f + ε)",
        &[("ε", EPSILON)],
        value,
    ))
}

/// Mean relative error, in [0, 1], which renders [estimate](opsr::resolve::Statement::mean): the mean over pixels of
/// Σ|I − f| / (Σf + 3ε), at most 1 each. Sums are over the channels; ε is a thirtieth of the mean radiance of the
/// reference, so that the number does not depend on the exposure.
pub fn mean_relative_error(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let errors = relative_error_map(test, reference)?;
    Ok(Metric::new(
        "mean relative error",
        "mean min(1, Σ|I − f| / (Σf + 3ε))",
        &[("ε", floor(light(reference)) / 3.0)],
        mean_of(errors.into_iter()),
    ))
}

/// Terms of [`mean_relative_error`], pixel by pixel.
pub fn relative_error_map(test: &Buffer, reference: &Buffer) -> Result<Vec<f64>, MetricError> {
    check(test, reference)?;
    let pairs = test.pixels.iter().zip(&reference.pixels);
    let errors = pairs.map(|(i, f)| (i.as_dvec3() - f.as_dvec3()).abs().element_sum());
    Ok(relative_errors(light(reference), errors).collect())
}

/// Sum of the channels of every pixel.
fn light(picture: &Buffer) -> impl Iterator<Item = f64> + Clone {
    picture.pixels.iter().map(|f| f.as_dvec3().element_sum())
}

/// Symmetric relative error, in [0, 1].
pub fn smape(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let f = |i: DVec3, f: DVec3| (i - f).abs() / (i.abs() + f.abs() + EPSILON);
    let value = mean(&errors(test, reference, f)?);
    Ok(Metric::new(
        "SMAPE",
        "mean |I − f| / (|I| + |f| + ε)",
        &[("ε", EPSILON)],
        value,
    ))
}

/// Mean of the picture over mean of the reference; infinite for a lit picture of a black reference, 1 for two black
/// pictures.
pub fn energy_ratio(test: &Buffer, reference: &Buffer) -> Result<Metric, MetricError> {
    let picture = mean(&errors(test, reference, |i, _| i)?);
    let wanted = mean(&errors(test, reference, |_, f| f)?);
    let value = if picture == wanted {
        1.0
    } else {
        picture / wanted
    };
    Ok(Metric::new("energy ratio", "mean I / mean f", &[], value))
}

/// All errors of this module, in the order of reports.
pub fn all(test: &Buffer, reference: &Buffer) -> Result<Vec<Metric>, MetricError> {
    type Measure = fn(&Buffer, &Buffer) -> Result<Metric, MetricError>;
    const ALL: [Measure; 8] = [
        mse,
        rmse,
        relmse,
        relmse_trimmed,
        mape,
        smape,
        mean_relative_error,
        energy_ratio,
    ];
    ALL.iter().map(|measure| measure(test, reference)).collect()
}

/// The pixel with the largest relative squared error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// (I − f)² / (f² + ε), averaged over channels.
    pub error: f64,
    /// The pixel in the picture.
    pub value: [f32; 3],
    /// The pixel in the reference.
    pub reference: [f32; 3],
}

/// Finds the pixel with the largest relative squared error; the first of equals.
pub fn worst(test: &Buffer, reference: &Buffer) -> Result<Worst, MetricError> {
    let all = errors(test, reference, relative_squared)?;
    let mut at = 0;
    for (i, e) in all.iter().enumerate() {
        if *e > all[at] {
            at = i;
        }
    }
    Ok(Worst {
        x: at % test.width,
        y: at / test.width,
        error: all[at],
        value: test.pixels[at].to_array(),
        reference: reference.pixels[at].to_array(),
    })
}
