//! Recording: paths are traced once and their events stored.
//!
//! A [`Crop`](crop::Crop) is traced with a [`Tape`](recording::Tape) as the observer. The tape samples every roughened
//! lobe with several [`proposals`], drops faint [`event`]s by Russian [`roulette`], and numbers the [`lists`] of
//! roughness values on which their α′ depends. The result is a [`Recording`](recording::Recording): a constant and a
//! few events for each path. A [`mod@file`] stores it, so that a stopped training can resume.

pub mod crop;
pub mod event;
pub mod file;
pub mod lists;
pub mod proposals;
pub mod recording;
pub mod roulette;
pub mod target;
pub mod visits;
