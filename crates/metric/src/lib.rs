//! Errors of a picture against its reference. Every number carries its formula and constants.
//!
//! | module | contents |
//! |---|---|
//! | [`pixel`] | squared, relative and absolute errors, energy, the worst pixel |
//! | [`seeds`] | bias² and variance apart, from several renders of one picture |
//! | [`flip`] | FLIP and HDR-FLIP: the difference a viewer sees |
//! | [`false_colour`] | colours of error maps |
//!
//! No pixel is skipped: a pixel that is not finite is an error, and so are pictures of different sizes.

pub mod false_colour;
pub mod flip;
pub mod pixel;
pub mod seeds;

use std::collections::BTreeMap;

use serde::Serialize;

use opsr::image::Buffer;

pub use pixel::{
    Worst, energy_ratio, mape, mean_relative_error, mse, relative_error_map, relmse,
    relmse_trimmed, rmse, smape, worst,
};
pub use seeds::{BiasVariance, bias_variance};

/// A number, the name of its formula, the formula and its constants.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metric {
    /// Short name, such as `relMSE`.
    pub name: &'static str,
    /// The formula, with I the picture and f the reference.
    pub formula: &'static str,
    /// Constants of the formula by their symbol or name.
    pub constants: BTreeMap<&'static str, f64>,
    /// The number.
    pub value: f64,
}

impl Metric {
    /// A metric with its constants.
    pub fn new(
        name: &'static str,
        formula: &'static str,
        constants: &[(&'static str, f64)],
        value: f64,
    ) -> Self {
        Self {
            name,
            formula,
            constants: constants.iter().copied().collect(),
            value,
        }
    }
}

/// Two pictures that cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricError {
    /// Their sizes differ.
    #[error("sizes differ: picture {}x{}, reference {}x{}", test.0, test.1, reference.0, reference.1)]
    Sizes {
        /// Size of the picture.
        test: (usize, usize),
        /// Size of the reference.
        reference: (usize, usize),
    },
    /// There are no pixels.
    #[error("pictures without pixels")]
    Empty,
    /// A pixel is not a number or infinite.
    #[error("{which}: pixel ({x}, {y}) is not finite, and {} more", count - 1)]
    NotFinite {
        /// Name of the picture.
        which: &'static str,
        /// Column of the first such pixel.
        x: usize,
        /// Its row.
        y: usize,
        /// Number of such pixels.
        count: usize,
    },
    /// Exposures cannot be taken from a reference without light.
    #[error("the reference is black: HDR-FLIP has no exposure to show it at")]
    BlackReference,
    /// Pixels per degree of sight outside of 1 to 1000.
    #[error("{0} pixels per degree is not within 1 to 1000")]
    PixelsPerDegree(f64),
    /// Bias and variance need several renders.
    #[error("bias and variance need at least two renders, there is {0}")]
    TooFew(usize),
}

/// An error unless the pictures have the same size and only finite pixels.
pub fn check(test: &Buffer, reference: &Buffer) -> Result<(), MetricError> {
    if test.size() != reference.size() {
        return Err(MetricError::Sizes {
            test: test.size(),
            reference: reference.size(),
        });
    }
    if reference.pixels.is_empty() {
        return Err(MetricError::Empty);
    }
    for (which, picture) in [("picture", test), ("reference", reference)] {
        if let Some(i) = picture.pixels.iter().position(|p| !p.is_finite()) {
            let (x, y) = (i % picture.width, i / picture.width);
            let count = picture.pixels.iter().filter(|p| !p.is_finite()).count();
            return Err(MetricError::NotFinite { which, x, y, count });
        }
    }
    Ok(())
}
