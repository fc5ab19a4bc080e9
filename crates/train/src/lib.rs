//! Learning the table: differentiable rendering without rays in the training loop (`docs/method.md` sections 4 to 7).
//!
//! A path sample is a constant plus a few *events*, each of which can be evaluated at any roughness. Training has three
//! parts, each of which uses the ones before:
//!
//! 1. [`record`] traces the paths of every crop once and stores their events.
//! 2. [`evaluate`] computes mean and second moment of every pixel, and their derivatives, at any table.
//! 3. [`learn`] sums loss and gradient over the crops, and Adam changes the table. burn holds the parameters and
//!    differentiates the loss of `method = "replay"`; the loss of the default, `tabulated`, is differentiated by hand.
//!
//! [`manifest`] lists the scenes, [`reference`](mod@reference) renders and stores the pictures that the loss compares
//! with, and [`config`] has the settings. [`score`] compares tables with constant factors; `examples/study.rs` scores
//! tables on scenes that they were not learned from.
//!
//! The chain rule from a table entry to the loss runs through `record/lists.rs` (dα′/dγ), `record/event.rs` (dx/dα′),
//! `evaluate/curves.rs` (the pixel's curve), `learn/loss.rs` (dL/dmoments), `learn/crop_set.rs` (the sum over crops),
//! and `learn/model.rs` (the step).

#[cfg(feature = "learn")]
pub mod config;
#[cfg(feature = "learn")]
pub mod derivative;
#[cfg(feature = "learn")]
pub mod evaluate;
#[cfg(feature = "learn")]
pub mod learn;
pub mod manifest;
#[cfg(feature = "learn")]
pub mod record;
pub mod reference;
#[cfg(feature = "learn")]
pub mod score;

#[cfg(feature = "learn")]
pub use config::Config;
#[cfg(feature = "learn")]
pub use learn::outer_loop::TrainError;
#[cfg(feature = "learn")]
pub use learn::recordings::{RecordingControl, Recordings};
#[cfg(feature = "learn")]
pub use learn::session::Session;
