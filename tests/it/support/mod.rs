//! Instruments that several tests share.

pub(crate) mod chi2;
pub(crate) mod gltf;
pub(crate) mod naive;
pub(crate) mod render;
pub(crate) mod slopes;
