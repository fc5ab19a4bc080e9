//! Learning: a [`session`] records the crops of a configuration once, and the [`outer_loop`] learns a table for each β:
//! [`loss`] and gradient summed over a [`crop_set`], a step of Adam on the parameters of a [`model`], validations, and
//! [`checkpoint`]s.

pub mod checkpoint;
pub mod crop_set;
pub mod loss;
pub mod model;
pub mod outer_loop;
pub mod session;
