//! Learning the table: differentiable rendering without a ray in the loop (`docs/method.md` sections 4 to 7).
//!
//! A path sample is a constant plus a few *events*, each of which can be evaluated at any roughness. So training is a
//! story in three rooms, each of which uses the ones before:
//!
//! 1. [`record`] traces the paths of every crop once and keeps their events.
//! 2. [`evaluate`] turns a recording into mean and second moment of every pixel, and their derivatives, at any table.
//! 3. [`learn`] sums loss and gradient over the crops and lets Adam change the table: burn holds the parameters and steps. It
//!    differentiates the loss of `method = "replay"`; that of `tabulated`, the default, is differentiated by hand.
//!
//! [`manifest`] lists the scenes, and [`reference`](mod@reference) has the pictures that the loss compares with.
//! [`config`] has the settings of all three. [`score`], on top, puts tables beside constants; `examples/study.rs` does so on
//! scenes that they were not learned from.
//!
//! A derivative travels from a lobe to its factor through `record/event.rs` (dx/dα′), `record/lists.rs` (dα′/dγ),
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
