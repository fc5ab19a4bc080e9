//! Learning: the loss, its gradient, Adam, and the outer loop.

pub mod checkpoint;
pub mod crop_set;
mod job;
pub mod model;
pub mod objective;
mod progress;
pub mod session;
