//! What unit tests of several modules share: materials and shapes of the laboratory.

#[path = "../../crates/lab/src/gallery/materials.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod materials;
#[path = "../../crates/lab/src/gallery/shapes.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod shapes;
