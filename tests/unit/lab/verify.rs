//! The laboratory's checks.

#[path = "../../../crates/lab/src/verify/bsdfs.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod bsdfs;
#[path = "../../../crates/lab/src/verify/chi_square.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod chi_square;
#[path = "../../../crates/lab/src/verify/finding.rs"]
#[allow(dead_code, unreachable_pub)]
mod finding;
#[path = "../../../crates/lab/src/verify/simple.rs"]
#[allow(dead_code, unreachable_pub)]
pub(crate) mod simple;

pub(crate) use finding::Finding;
