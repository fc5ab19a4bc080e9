//! Comparisons, benches and their pages.

pub mod bench;
pub mod compare;
pub mod page;
#[cfg(feature = "train")]
pub mod training;
