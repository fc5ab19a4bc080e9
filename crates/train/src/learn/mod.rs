//! Learning: a [`session`] prepares the [`recordings`] of a configuration's crops, and the [`outer_loop`] learns a
//! table for each β. A step sums [`loss`] and gradient over a [`crop_set`] and moves the parameters of a [`model`] by
//! Adam, with a prior; validations and [`checkpoint`]s follow at intervals.

pub mod checkpoint;
pub mod crop_set;
pub mod loss;
pub mod model;
pub mod outer_loop;
mod prior;
pub mod recordings;
pub mod session;
