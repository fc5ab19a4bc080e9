//! The errors of a picture by name, and the products of errors that tell bias from noise.

use std::collections::BTreeMap;

use crate::image::Buffer;
use crate::image::metric::{self, MetricError, flip, pixel::EPSILON};

/// All errors of a picture by name.
pub fn errors(
    picture: &Buffer,
    reference: &Buffer,
    exposure: f32,
) -> Result<BTreeMap<String, f64>, MetricError> {
    let mut errors: BTreeMap<String, f64> = (metric::pixel::all(picture, reference)?.iter())
        // The root of MSE says nothing new.
        .filter(|m| m.name != "RMSE")
        .map(|m| (m.name.to_owned(), m.value))
        .collect();
    let scale = exposure.exp2();
    let shown = |b: &Buffer| b.map(|p| p * scale);
    let map = flip::ldr(&shown(picture), &shown(reference), flip::DEFAULT_PPD)?;
    errors.insert("FLIP".to_owned(), map.mean);
    Ok(errors)
}

/// Mean of (Iₖ − f)(Iₗ − f)/(f² + ε) over pixels and channels.
pub fn error_products(pictures: &[Buffer], reference: &Buffer) -> Vec<Vec<f64>> {
    let scaled = |p: &Buffer| -> Vec<f64> {
        let pairs = p.pixels.iter().zip(&reference.pixels);
        let channels = pairs.flat_map(|(i, f)| {
            std::array::from_fn::<_, 3, _>(|c| (f64::from(i[c]), f64::from(f[c])))
        });
        channels
            .map(|(i, f)| (i - f) / (f * f + EPSILON).sqrt())
            .collect()
    };
    let errors: Vec<Vec<f64>> = pictures.iter().map(scaled).collect();
    let product =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>() / a.len() as f64;
    errors
        .iter()
        .map(|a| errors.iter().map(|b| product(a, b)).collect())
        .collect()
}
