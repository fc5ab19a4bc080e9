//! A plain RGB picture.

use crate::math::Rgb;

/// A picture of linear RGB values, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Buffer {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// `width * height` pixels, row by row.
    pub pixels: Vec<Rgb>,
}
