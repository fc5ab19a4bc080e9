//! Benches: methods against each other on scenes with references, at equal time and at equal samples.
//!
//! | module | contents |
//! |---|---|
//! | [`suite`] | scenes, methods, seeds and time points, from a TOML file |
//! | [`run`](mod@run) | measures: one progressive run per scene, method and seed; resumable |
//! | [`results`] | the measurements, as JSON |
//! | [`errors`] | the errors of a picture |
//! | [`curve`] | errors at a time or a number of samples, and the crossing of two methods |
//! | [`summary`] | the comparisons of a scene |
//! | [`overall`] | the comparisons over many scenes |
//! | [`page`] | the report as one HTML file |
//! | [`machine`] | memory, processor |

use opsr::files::FileError;

mod check;
pub mod curve;
pub mod errors;
pub mod machine;
pub mod overall;
pub mod page;
mod prepare;
pub mod results;
pub mod run;
mod schedule;
pub mod suite;
pub mod summary;

pub use results::Results;
pub use run::{Outcome, Status, run};
pub use suite::Suite;

/// A bench that cannot be run or read.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A file that cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// A scene of the suite, or a method on it.
    #[error("scene {place}: {reason}")]
    Scene {
        /// Name of the scene, and of the method if the fault is in a method.
        place: String,
        /// The fault.
        reason: String,
    },
}

impl BenchError {
    /// True if the fault is in the output file rather than in the input.
    pub fn is_output(&self) -> bool {
        matches!(self, Self::File(e) if e.is_write())
    }
}
