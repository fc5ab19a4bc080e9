//! Files: bounded reads, writes that are whole or not made, sealed files, locks, hashes in hex.
//!
//! Errors of this crate follow one convention: the text is complete, its cause included, and `source()` is `None`. Both
//! `{error}` and anyhow's `{error:#}` print everything once.

mod error;
mod lock;
mod read;
mod sealed;
#[cfg(feature = "toml")]
mod toml;
mod write;

pub use error::{FileError, Problem};
pub use lock::Claim;
pub(crate) use read::stream;
pub use read::{briefly, read, read_text};
pub use sealed::{Payload, Sealed};
#[cfg(feature = "toml")]
pub use toml::toml;
pub(crate) use write::Target;
pub use write::{create_folder, write, write_bytes};

/// Lower-case hexadecimal digits of a hash.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
