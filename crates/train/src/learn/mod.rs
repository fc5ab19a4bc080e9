//! Learning: a [`session`] takes the [`recordings`] of the crops of a configuration, and the [`outer_loop`] learns a table
//! for each β: [`loss`] and gradient summed over a [`crop_set`], a step of Adam on the parameters of a [`model`] under a prior,
//! validations, and [`checkpoint`]s.

pub mod checkpoint;
pub mod crop_set;
pub mod loss;
pub mod model;
pub mod outer_loop;
mod prior;
pub mod recordings;
pub mod session;
