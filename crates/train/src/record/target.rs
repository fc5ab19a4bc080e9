//! Target of a crop: its reference, and the constants of the loss.

/// ε of MAPE, in units of the scaled reference.
pub const EPSILON: f32 = 0.01;

/// Mean to which the reference of every crop is scaled. The variance has the unit of radiance squared and MAPE has
/// none, so that without a common scale β would weigh the variance differently in each crop.
pub const BRIGHTNESS: f32 = 0.3;

/// The reference of a crop and the number of samples that the loss assumes.
#[derive(Clone, Debug)]
pub struct Target {
    /// Converged, unregularised radiance, unscaled, row by row.
    pub reference: Vec<[f32; 3]>,
    /// Samples per pixel N that the table is learned for.
    pub samples: u32,
}

impl Target {
    /// Factor that scales the reference to the mean [`BRIGHTNESS`]; 1 for a black reference.
    pub fn scale(&self) -> f32 {
        let sum: f64 = self.reference.iter().flatten().map(|&v| f64::from(v)).sum();
        let mean = sum / (3 * self.reference.len().max(1)) as f64;
        if mean > 0.0 {
            (f64::from(BRIGHTNESS) / mean) as f32
        } else {
            1.0
        }
    }
}
