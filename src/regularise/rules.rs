//! Rules of other renderers, for comparison. All of them blur the continuation of the path too, which OPSR does not.

use super::{Regulariser, Scattered};

/// pbrt-v4's `regularize`: after any bounce that was not perfectly specular, a lobe below 0.3 is doubled and clamped
/// to [0.1, 0.3].
#[derive(Clone, Copy, Debug, Default)]
pub struct PbrtRegularize;

impl Regulariser for PbrtRegularize {
    /// Whether a bounce that was not perfectly specular has happened.
    type Path = bool;
    const ACTIVE: bool = true;
    const REUSE: bool = true;

    fn start(&self, _: u32) -> bool {
        false
    }

    #[inline]
    fn roughen(&self, &blurred: &bool, alpha: f32) -> f32 {
        if blurred && alpha < 0.3 {
            (2.0 * alpha).clamp(0.1, 0.3)
        } else {
            alpha
        }
    }

    #[inline]
    fn scatter(&self, blurred: &mut bool, vertex: Scattered) {
        *blurred |= vertex.alpha > 0.0;
    }
}

/// Cycles' "filter glossy" with filter value F: with p the smallest density sampled so far and b = p/F < 1,
/// α′ = max(α, ½ √(1 − b)).
#[derive(Clone, Copy, Debug)]
pub struct FilterGlossy {
    /// F > 0; larger filters more.
    pub filter: f32,
}

impl Regulariser for FilterGlossy {
    /// The smallest density so far.
    type Path = f32;
    const ACTIVE: bool = true;
    const REUSE: bool = true;

    fn start(&self, _: u32) -> f32 {
        f32::INFINITY
    }

    #[inline]
    fn roughen(&self, &smallest: &f32, alpha: f32) -> f32 {
        let b = smallest / self.filter;
        if b < 1.0 {
            alpha.max(0.5 * (1.0 - b).sqrt())
        } else {
            alpha
        }
    }

    #[inline]
    fn scatter(&self, smallest: &mut f32, vertex: Scattered) {
        *smallest = smallest.min(vertex.pdf_w);
    }
}

/// Roughness clamp: no lobe is sharper than the roughest one before it.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoughnessClamp;

impl Regulariser for RoughnessClamp {
    /// The largest roughness so far.
    type Path = f32;
    const ACTIVE: bool = true;
    const REUSE: bool = true;

    fn start(&self, _: u32) -> f32 {
        0.0
    }

    #[inline]
    fn roughen(&self, &largest: &f32, alpha: f32) -> f32 {
        alpha.max(largest)
    }

    #[inline]
    fn scatter(&self, largest: &mut f32, vertex: Scattered) {
        *largest = largest.max(vertex.alpha);
    }
}
