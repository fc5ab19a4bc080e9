//! Learning: a [`session`] takes the [`recordings`] of the crops of a configuration, and the [`outer_loop`] learns a table
//! for each β: [`loss`] and gradient summed over a [`crop_set`], a step of Adam on the parameters of a [`model`],
//! validations, and [`checkpoint`]s.

pub mod checkpoint;
pub mod crop_set;
pub mod loss;
pub mod model;
pub mod outer_loop;
pub mod recordings;
pub mod session;
