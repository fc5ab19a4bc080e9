//! Evaluation: mean and second moment of every pixel of a crop, and their derivatives, at any table.
//!
//! Two sources of the same numbers (`docs/method.md` section 7): [`replay`] evaluates the events of a recording one by
//! one, and [`curves`] reads tabulated curves over the factor, with `folded` for the paths that have none. Between exact
//! evaluations they extrapolate the moments linearly by a sparse `jacobian`.

pub mod curves;
mod folded;
mod jacobian;
pub mod replay;

use opsr::regularise::{AttenuationTable, LEN};

/// Smallest factor that is learned: at exactly 0 a Dirac lobe stays one and has no gradient, so that a factor could
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
    /// Zeros.
    pub fn zero(pixels: usize) -> Self {
        Self {
            mean: vec![[0.0; 3]; pixels],
            second: vec![0.0; pixels],
        }
    }
}

/// Moments of a crop at any table, and their derivatives.
pub trait MomentSource: Send + Sync {
    /// Moments at a table, by tangents where the source has them.
    fn moments(&mut self, table: &AttenuationTable) -> Moments;

    /// Moments at a table without tangents, which stay as they are.
    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        self.moments(table)
    }

    /// Gradient dL/dγ of all factors, given dL/dmoments, at the table of the last call of [`MomentSource::moments`].
    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64>;

    /// Linearises at a table whatever the source linearises.
    fn anchor(&mut self, _table: &AttenuationTable) {}

    /// Adds, per class, the light in the linearised part that depends on the factor: Σ |d mean / d ln γ| at the anchor.
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
