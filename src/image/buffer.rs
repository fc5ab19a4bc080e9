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

impl Buffer {
    /// A picture whose pixel at column x, row y is `f(x, y)`.
    ///
    /// ```
    /// use opsr::{image::Buffer, math::Rgb};
    /// let ramp = Buffer::from_fn(4, 2, |x, _| Rgb::splat(x as f32));
    /// assert_eq!(ramp.pixels[7], Rgb::splat(3.0));
    /// ```
    pub fn from_fn(width: usize, height: usize, f: impl Fn(usize, usize) -> Rgb) -> Self {
        let pixels = (0..width * height)
            .map(|i| f(i % width, i / width))
            .collect();
        Self {
            width,
            height,
            pixels,
        }
    }

    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, value: Rgb) -> Self {
        Self::from_fn(width, height, |_, _| value)
    }

    /// (width, height).
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The pixel at column x, row y. Panics outside the picture.
    pub(crate) fn get(&self, x: usize, y: usize) -> Rgb {
        self.pixels[y * self.width + x]
    }

    /// The same picture with every pixel changed by `f`.
    pub fn map(&self, f: impl Fn(Rgb) -> Rgb) -> Self {
        Self {
            pixels: self.pixels.iter().map(|&p| f(p)).collect(),
            ..*self
        }
    }
}
