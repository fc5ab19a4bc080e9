//! Comparisons, benches and their pages.

pub mod bench;
pub mod compare;
pub mod page;
mod plot;
#[cfg(feature = "train")]
pub mod training;
