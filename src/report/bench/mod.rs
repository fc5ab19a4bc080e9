//! Benches: methods against each other on scenes with references, at equal time and at equal samples.
//!
//! | room | what |
//! |---|---|
//! | [`suite`] | what to measure, from a TOML file |
//! | [`run`] | measures: one progressive run per scene, method and seed; can be stopped and gone on with |
//! | [`results`] | what was measured, as JSON |
//! | [`errors`] | the errors of a picture |
//! | [`curve`] | errors at a time, at a number of samples, and where two methods cross |
//! | [`stats`] | ratios over seeds with intervals and verdicts, bias |
//! | [`summary`] | the comparisons of a scene |
//! | [`overall`] | the comparisons over many scenes |
//! | [`page`] | the report as one HTML file |
//! | [`machine`] | clocks, memory, processor |

use std::path::PathBuf;

mod check;
pub mod curve;
pub mod errors;
pub mod machine;
mod marks;
pub mod overall;
pub mod page;
mod prepare;
pub mod results;
pub mod run;
pub mod suite;
pub mod summary;
mod vary;

pub use results::Results;
pub use run::{Outcome, Status, run};
pub use suite::Suite;

/// A bench that cannot be run or read.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The suite's file.
    #[error("{}: {reason}", path.display())]
    Suite {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file of results.
    #[error("{}: not results of a bench that this program reads: {reason}", path.display())]
    Results {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A scene of the suite.
    #[error("scene `{scene}`: {reason}")]
    Scene {
        /// Its name.
        scene: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A scene file.
    #[error(transparent)]
    Load(#[from] crate::scene::load::LoadError),
    /// A table file.
    #[error(transparent)]
    Table(#[from] crate::regularise::file::TableError),
    /// A picture.
    #[error(transparent)]
    Exr(#[from] crate::image::exr::ExrError),
    /// A picture that cannot be compared with its reference.
    #[error("scene `{scene}`, method `{method}`: {reason}")]
    Compare {
        /// The scene.
        scene: String,
        /// The method.
        method: String,
        /// Why not.
        reason: crate::image::metric::MetricError,
    },
    /// A file that cannot be written.
    #[error("{}: cannot be written: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
}

impl BenchError {
    /// Whether the place to write to is at fault, rather than the input.
    pub fn is_output(&self) -> bool {
        matches!(self, Self::Write { .. })
    }
}
