//! Evaluation: moments of every pixel and their derivatives, at any table.

pub mod curves;
mod folded;
pub mod fresh;
pub(crate) mod grid;
pub mod moments;
pub mod replay;
mod sums;
