//! The uniform numbers of a draw from a BSDF.

use super::slope::Quantiles;
use std::cell::OnceCell;

/// Uniform numbers in [0, 1) from which a BSDF draws a lobe and a direction: three numbers, or [`SharedNumbers`] for
/// several draws.
pub trait LobeNumbers: Copy {
    /// One number for the choice of the lobe and two for the direction.
    fn uniform(self) -> [f32; 3];

    /// Gaussian quantiles of the two numbers for the direction.
    fn quantiles(self) -> Quantiles;
}

impl LobeNumbers for [f32; 3] {
    #[inline(always)]
    fn uniform(self) -> Self {
        self
    }

    #[inline(always)]
    fn quantiles(self) -> Quantiles {
        Quantiles::of([self[1], self[2]])
    }
}

/// Numbers of several draws at one vertex at different roughnesses. The quantiles do not depend on the roughness, and
/// are computed by the first draw that needs them.
#[derive(Debug)]
pub struct SharedNumbers {
    uniform: [f32; 3],
    quantiles: OnceCell<Quantiles>,
}

impl SharedNumbers {
    /// Shares these numbers in [0, 1).
    #[inline(always)]
    pub(crate) fn new(uniform: [f32; 3]) -> Self {
        Self {
            uniform,
            quantiles: OnceCell::new(),
        }
    }
}

impl LobeNumbers for &SharedNumbers {
    #[inline(always)]
    fn uniform(self) -> [f32; 3] {
        self.uniform
    }

    #[inline(always)]
    fn quantiles(self) -> Quantiles {
        *self.quantiles.get_or_init(|| self.uniform.quantiles())
    }
}
