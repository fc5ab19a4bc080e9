//! What can be wrong with a file.

use std::path::PathBuf;

/// Why a scene could not be loaded; the message names the file and the place in it.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A file could not be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file breaks the rules of glTF, or asks for more than this loader can do.
    #[error("{}: {place}: {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where in the file: a JSON path such as `accessors[3]`, with the name where there is one.
        place: String,
        /// What is wrong there.
        what: String,
    },
    /// The file cannot be shown without an extension that this loader does not know.
    #[error("{}: extensionsRequired: {name} is not supported", path.display())]
    Extension {
        /// The file.
        path: PathBuf,
        /// Name of the extension.
        name: String,
    },
}
