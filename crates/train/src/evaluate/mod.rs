//! Evaluation: mean and second moment of every pixel of a crop, and their derivatives, at any table.
//!
//! Two sources compute these moments (`docs/method.md` section 7). [`replay`] evaluates the events of a recording one
//! by one; [`curves`] interpolates tabulated curves over the factor, and `folded` adds the paths without curves.
//! Between exact evaluations `curves` and `folded` extrapolate the moments linearly by a sparse `jacobian`.

pub mod curves;
mod folded;
mod jacobian;
pub mod replay;

use opsr::regularise::{AttenuationTable, LEN};

/// Smallest factor that is learned. At 0 a Dirac lobe stays a Dirac lobe and has no gradient, so that a factor could
/// never leave 0.
pub(crate) const GAMMA_MIN: f32 = 1e-3;

/// Mean and second moment of one path sample, for every pixel of a crop.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// E\[X\] per channel.
    pub mean: Vec<[f32; 3]>,
    /// E\[X²\], summed over the channels.
    pub second: Vec<f32>,
}

/// Derivative of the loss with respect to a crop's [`Moments`].
pub type Adjoint = Moments;

impl Moments {
    /// Zeros for this number of pixels.
    pub fn zero(pixels: usize) -> Self {
        Self {
            mean: vec![[0.0; 3]; pixels],
            second: vec![0.0; pixels],
        }
    }
}

/// Moments of a crop at any table, and their derivatives.
pub trait MomentSource: Send + Sync {
    /// Moments at a table, extrapolated by tangents if the source stores tangents.
    fn moments(&mut self, table: &AttenuationTable) -> Moments;

    /// Moments at a table, evaluated without tangents; stored tangents do not change.
    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        self.moments(table)
    }

    /// Gradient dL/dγ of all factors, given dL/dmoments, at the table of the last call of [`MomentSource::moments`].
    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64>;

    /// Linearises the folded paths at a table; does nothing in a source without such tangents.
    fn anchor(&mut self, _table: &AttenuationTable) {}

    /// Adds Σ |d mean / d ln γ| of the linearised paths at the anchor to `weights`, class by class.
    fn add_weights(&self, _weights: &mut [f64]) {}

    /// Cost of a step relative to other crops, in any unit.
    fn work(&self) -> usize {
        0
    }

    /// Approximate memory in bytes.
    fn bytes(&self) -> usize {
        0
    }
}

/// A gradient of zeros.
pub(crate) fn no_gradient() -> Vec<f64> {
    vec![0.0; LEN]
}
