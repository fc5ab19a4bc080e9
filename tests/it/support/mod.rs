//! Instruments that several tests share.

pub(crate) mod naive;
pub(crate) mod render;
