//! Splats: contributions of light paths to pixels that the path determines.
//!
//! Floating-point addition is not associative, so splats are kept as a list and added in the order of their light
//! paths: a picture is bit-identical at any number of threads. Values span the whole range of radiance, which no
//! fixed-point sum can represent.

use super::film::Window;
use crate::math::{DVec3, Rgb, UVec2};

/// A value for one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Splat {
    /// Index of the pixel in the window, row by row.
    pub index: u32,
    /// The value.
    pub value: Rgb,
}

impl Splat {
    /// A value for a pixel of the full frame; `None` outside the window.
    #[inline]
    pub(crate) fn new(window: &Window, pixel: UVec2, value: Rgb) -> Option<Self> {
        let x = pixel.x.checked_sub(window.x).filter(|&x| x < window.w)?;
        let y = pixel.y.checked_sub(window.y).filter(|&y| y < window.h)?;
        let index = y * window.w + x;
        Some(Self { index, value })
    }
}

/// Sums of splats over the pixels of a window.
#[derive(Clone, Debug)]
pub(crate) struct SplatLayer {
    sums: Vec<DVec3>,
}

impl SplatLayer {
    /// Bytes per pixel.
    pub(crate) const PIXEL_BYTES: u64 = size_of::<DVec3>() as u64;

    /// An empty layer of a window.
    pub(crate) fn new(window: &Window) -> Self {
        Self {
            sums: vec![DVec3::ZERO; window.len()],
        }
    }

    /// Adds splats in their order, times a factor.
    pub(crate) fn add_in_order(&mut self, splats: &[Splat], factor: f64) {
        for splat in splats {
            self.sums[splat.index as usize] += factor * splat.value.as_dvec3();
        }
    }

    /// Adds another layer of the same window, times a factor.
    pub(crate) fn add_layer(&mut self, other: &Self, factor: f64) {
        for (sum, more) in self.sums.iter_mut().zip(&other.sums) {
            *sum += factor * *more;
        }
    }

    /// Multiplies all sums by a factor.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.sums.iter_mut().for_each(|sum| *sum *= factor);
    }

    /// Sum of the pixel with this index.
    pub(crate) fn value(&self, index: usize) -> Rgb {
        self.sums[index].as_vec3()
    }

    /// The sums, row by row; the layer is empty again.
    pub(crate) fn take(&mut self) -> impl Iterator<Item = Rgb> + '_ {
        self.sums
            .iter_mut()
            .map(|sum| std::mem::take(sum).as_vec3())
    }
}
