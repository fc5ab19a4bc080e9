//! Meshes and materials made in code.

pub mod materials;
pub mod shapes;
