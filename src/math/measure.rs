//! Measures: solid angle and area, and the weights of multiple importance sampling.

use super::Vec3;

/// Converts a density per area at a point of a surface into a density per solid angle as seen from `from`.
///
/// `d = |to - from|`, `cos` the absolute cosine at the surface. Zero where the surface is seen edge on would be
/// an infinite density; such points are never sampled and the caller gets infinity.
#[inline]
pub fn area_to_solid_angle(pdf_a: f32, from: Vec3, to: Vec3, cos: f32) -> f32 {
    pdf_a * from.distance_squared(to) / cos
}

/// Weight of a technique with density `p` against one with density `q`, balance heuristic `[Veach97 (9.9)]`.
///
/// In ratio form, so that densities from 1e-38 to 1e38 give finite weights; `p = 0` gives 0.
#[inline]
pub fn balance(p: f32, q: f32) -> f32 {
    if p > 0.0 { 1.0 / (1.0 + q / p) } else { 0.0 }
}
