//! The laboratory's scenes, statistics and checks, compiled with the library.

#[path = "../../../crates/lab/src/gallery/mod.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod gallery;
#[path = "../../../crates/lab/src/stats/mod.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod stats;
pub(crate) mod verify;
