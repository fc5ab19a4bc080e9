//! Table files with the writes and errors of this crate; the format is that of `opsr-table`.

use crate::files::{self, FileError, Problem};
pub use opsr_table::file::{Provenance, TableFile, VERSION};
use opsr_table::file::{TableError, TableProblem};
use std::path::Path;

impl From<TableError> for FileError {
    fn from(error: TableError) -> Self {
        let problem = match error.problem {
            TableProblem::Read(error) => Problem::Read(error),
            TableProblem::Content(text) => Problem::content(text),
        };
        problem.at(&error.path)
    }
}

/// Writes a table file, whole or not at all.
pub fn save(file: &TableFile, path: &Path) -> Result<(), FileError> {
    let text = file.to_json().map_err(|e| FileError::content(path, e))?;
    files::write_bytes(path, text)
}
