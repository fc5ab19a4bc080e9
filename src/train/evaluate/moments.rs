//! What the objective sees of a crop, and the three ways to get it.

use crate::regularise::{AttenuationTable, LEN};

/// Mean and second moment of one path sample, for every pixel of a crop.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// E[X] per channel.
    pub mean: Vec<[f32; 3]>,
    /// E[X²], summed over the channels.
    pub second: Vec<f32>,
}

/// Derivative of the loss with respect to a crop's [`Moments`], which it has the shape of.
pub type Adjoint = Moments;

/// Moments of a crop at any table, and their derivative.
pub trait MomentSource: Send + Sync {
    /// The moments at this table.
    fn moments(&mut self, table: &AttenuationTable) -> Moments;

    /// The moments at this table without the use of tangents, which stay as they are.
    fn exact(&mut self, table: &AttenuationTable) -> Moments {
        self.moments(table)
    }

    /// dL/dγ of all factors, given dL/dmoments, at the table that the moments were asked for last.
    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64>;

    /// Adds the light that follows each factor in what is linearised: Σ |d mean / d ln γ| at the anchor.
    fn add_weights(&self, _weights: &mut [f64]) {}

    /// How long the moments and their derivative take beside those of other crops, in any unit.
    fn work(&self) -> usize {
        0
    }

    /// Linearises what is linearised at this table.
    fn anchor(&mut self, _table: &AttenuationTable) {}

    /// Goes on as if the moments had been asked for this many times since the start.
    fn skip(&mut self, _times: u64) {}

    /// Bytes held, near enough.
    fn bytes(&self) -> usize {
        0
    }
}

impl Moments {
    /// All zero.
    pub fn zero(pixels: usize) -> Self {
        Self {
            mean: vec![[0.0; 3]; pixels],
            second: vec![0.0; pixels],
        }
    }
}

/// A gradient of zeros.
pub(in crate::train) fn no_gradient() -> Vec<f64> {
    vec![0.0; LEN]
}
