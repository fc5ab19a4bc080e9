//! The errors of a picture by name, and products of errors, which separate bias from noise.

use std::collections::BTreeMap;

use opsr::image::Buffer;
use opsr::image::film::Window;
use opsr::image::relative::EPSILON;
use opsr::math::UVec2;
use opsr::resolve::Resolved;
use opsr_metric::{self as metric, MetricError, flip};

/// All errors of a picture by name.
pub fn errors(
    picture: &Buffer,
    reference: &Buffer,
    exposure: f32,
) -> Result<BTreeMap<String, f64>, MetricError> {
    let mut errors: BTreeMap<String, f64> = (metric::pixel::all(picture, reference)?.iter())
        // RMSE is the root of MSE.
        .filter(|m| m.name != "RMSE")
        .map(|m| (m.name.to_owned(), m.value))
        .collect();
    let scale = exposure.exp2();
    let shown = |b: &Buffer| b.map(|p| p * scale);
    let map = flip::ldr(&shown(picture), &shown(reference), flip::DEFAULT_PPD)?;
    errors.insert("FLIP".to_owned(), map.mean);
    Ok(errors)
}

/// Pixels along a side of the tiles on which an error map is compared with the true error.
const MAP_TILE: u32 = 8;

/// The error map of a picture against its true error, the [mean relative error](metric::mean_relative_error) of tiles:
/// geometric mean of estimated over true error, and Spearman's rank correlation of the two.
pub fn error_map(
    resolved: &Resolved,
    reference: &Buffer,
) -> Result<[(String, f64); 2], MetricError> {
    let picture = &resolved.picture;
    let (map, truth) = (
        resolved.error(),
        metric::relative_error_map(picture, reference)?,
    );
    let whole = Window::full(UVec2::new(picture.width as u32, picture.height as u32));
    let (estimates, truths): (Vec<f64>, Vec<f64>) = whole
        .tiles(MAP_TILE)
        .iter()
        .map(|tile| {
            let rows = tile.y..tile.y + tile.h;
            let pixels = rows.flat_map(|y| {
                (tile.x..tile.x + tile.w).map(move |x| y as usize * picture.width + x as usize)
            });
            pixels.fold((0.0, 0.0), |(e, t), i| {
                (e + f64::from(map[i]), t + truth[i])
            })
        })
        .unzip();
    let pairs = || estimates.iter().zip(&truths);
    let logs: Vec<f64> = pairs()
        .filter(|(e, t)| **e > 0.0 && **t > 0.0)
        .map(|(e, t)| (e / t).ln())
        .collect();
    let ratio = (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp();
    let (a, b) = (ranks(&estimates), ranks(&truths));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product: f64 = a.iter().zip(&b).map(|(x, y)| (x - mean) * (y - mean)).sum();
    let square: f64 = a.iter().map(|x| (x - mean) * (x - mean)).sum();
    Ok([
        ("error map ratio".to_owned(), ratio),
        ("error map rank".to_owned(), product / square.max(1e-30)),
    ])
}

/// Rank of every value, from 0.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for (rank, i) in order.into_iter().enumerate() {
        ranks[i] = rank as f64;
    }
    ranks
}

/// Products of errors for all pairs of pictures: mean of (Iₖ − f)(Iₗ − f)/(f² + ε) over pixels and channels.
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
