//! Files: bounded reads, writes that are whole or not made, sealed files, hashes in hex.
//!
//! Errors of this crate follow one convention: the text is complete, its cause included, and `source()` is `None`.
//! So `{error}` and anyhow's `{error:#}` say everything once.

mod error;
mod read;
mod sealed;
mod write;

pub use error::{FileError, Problem};
pub(crate) use read::{briefly, stream, toml};
pub use read::{read, read_text};
pub(crate) use sealed::{Payload, Sealed};
pub use write::{Target, create_folder, write, write_bytes};

/// Lower-case hexadecimal digits of a hash.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
