//! Comparisons, benches and their pages.

pub mod bench;
pub mod compare;
mod html;
pub mod page;
mod plot;
pub mod tensorboard;
#[cfg(feature = "train")]
pub mod training;
