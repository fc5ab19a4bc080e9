//! Recording: paths are traced once and their events kept.
//!
//! A [`Crop`](crop::Crop) is traced with a [`Tape`](recording::Tape) as the observer. The tape samples every roughened
//! lobe with several [`proposals`], plays Russian [`roulette`] with faint [`event`]s, and numbers the [`lists`] of
//! roughness values on which their α′ depends. The result is a [`Recording`](recording::Recording): per path a constant
//! and a few events; a [`mod@file`] keeps it for a training that is stopped.

pub mod crop;
pub mod event;
pub mod file;
pub mod lists;
pub mod proposals;
pub mod recording;
pub mod roulette;
pub mod target;
pub mod visits;
