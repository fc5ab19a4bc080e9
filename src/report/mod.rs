//! Comparisons, benches and their pages.

pub mod compare;
pub mod page;
