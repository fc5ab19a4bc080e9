//! Recording: paths are traced once, their events kept.

pub mod crop;
pub mod event;
mod intern;
pub mod lists;
pub mod proposals;
pub mod recording;
pub mod roulette;
pub mod visits;
