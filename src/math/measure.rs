//! Change of measure between area and solid angle, and weights of multiple importance sampling.

use super::Vec3;

/// Converts a density `pdf_a` per area at `to` into a density per steradian seen from `from`: pdf_a d² / cos, with
/// d = |to − from| and `cos` the absolute cosine at the surface of `to`. Infinite for a surface seen edge on.
#[inline]
pub(crate) fn area_to_solid_angle(pdf_a: f32, from: Vec3, to: Vec3, cos: f32) -> f32 {
    pdf_a * from.distance_squared(to) / cos
}

/// Balance heuristic p / (p + q) `[Veach97 (9.8)]`: weight in [0, 1] of a technique with density `p` against one with
/// density `q` in the same measure.
///
/// The ratio form gives finite weights for densities from 1e-38 to 1e38; `p = 0` gives 0.
#[inline]
pub fn balance(p: f32, q: f32) -> f32 {
    if p > 0.0 { 1.0 / (1.0 + q / p) } else { 0.0 }
}
