//! Learning the table: differentiable rendering without a ray in the loop.
//!
//! A path sample is a constant plus a few [events](event), each of which can be evaluated at any roughness. So paths
//! are traced once ([`recording`]); mean and second moment of every pixel, and their derivatives, are then functions of
//! the table alone ([`moments::MomentSource`]): exactly, event by event ([`replay`]), or from baked [`curves`]; [`fresh`] traces
//! at every step and checks the others. burn holds the parameters ([`model`]), differentiates the loss ([`objective`];
//! the fast way repeats its roundings in loops) and steps Adam; it never sees a ray. [`session`] is the outer loop;
//! [`study`] says what came out of it.

pub mod config;
pub mod evaluate;
pub mod learn;
pub mod record;
pub mod study;

pub use config::Config;
pub use learn::session::{Session, TrainError};
