//! Attenuation tables of optimised path space regularisation, for any path tracer.
//!
//! At next-event estimation the last surface of a path is roughened a little. The amount depends on the roughness of the
//! path so far and on a learned table of [`LEN`] *attenuation factors*. A renderer makes two calls:
//!
//! ```
//! use opsr_table::{PathRoughness, TableFile};
//!
//! let table = TableFile::load("beta-0.001".as_ref())?.table;
//! let mut path = PathRoughness::default();
//! // A diffuse floor: nothing is rougher, and the path remembers it.
//! path.push(1.0, &table, 1.0);
//! // Light sampled at a polished metal after it: the lobe is evaluated at this roughness instead of its own.
//! let alpha_reg = path.accumulate(0.05, &table, 1.0);
//! assert!(alpha_reg > 0.05 && alpha_reg < 1.0);
//! # Ok::<(), opsr_table::TableError>(())
//! ```
//!
//! Roughness is Beckmann's, in [0, 1]: 0 is a Dirac lobe, 1 is Lambert. [`mod@file`] reads and writes table files,
//! [`mod@export`] turns them into source code for other renderers.
//!
//! `[OPSR]` is Weier, Droske, Hanika, Weidlich, Vorba: *Optimised Path Space Regularisation*, EGSR 2021.

pub mod export;
pub mod file;
mod roughness;
mod table;

pub use file::{TableError, TableFile};
pub use roughness::{
    BIN_EDGES, BINS, GammaIndex, MAX_VERTICES, PathRoughness, bin, bin_coordinate,
};
pub use table::{AttenuationTable, LEN, Lookup};

/// A source of the attenuation factor γ in [0, 1] of a path.
pub trait Attenuation: Sync {
    /// γ of a path with this prefix, which is not empty, whose last vertex has roughness `last`.
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32;
}

/// One γ for every path: the paper's naive variant.
#[derive(Clone, Copy, Debug)]
pub struct ConstantGamma(pub f32);

impl Attenuation for ConstantGamma {
    #[inline]
    fn gamma(&self, _: &PathRoughness, _: f32) -> f32 {
        self.0
    }
}
