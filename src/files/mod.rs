//! Files: read in bounds, written whole or not at all.

mod hex;
mod read;
mod write;

pub use hex::hex;
pub(crate) use read::{briefly, stream, toml};
pub use read::{read, read_text};
pub use write::{write, write_bytes};
