//! Steps that every estimator borrows: the shading point, direct light, enclosing bodies, observers.

pub(super) mod bodies;
pub mod observer;
pub(super) mod pending_emission;
pub(super) mod shading_point;
