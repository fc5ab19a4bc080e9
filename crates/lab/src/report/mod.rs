//! Comparisons, benches and their pages.

pub mod bench;
pub mod compare;
#[cfg(feature = "train")]
mod factors;
mod html;
pub mod page;
mod plot;
#[cfg(feature = "train")]
pub mod training;
