//! Comparisons, benches and their pages.

pub mod bench;
pub mod compare;
mod html;
pub mod page;
mod plot;
#[cfg(feature = "train")]
pub mod training;
