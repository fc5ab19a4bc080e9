//! Errors of the library as Python exceptions.

use opsr::files::{FileError, Problem};
use pyo3::PyErr;
use pyo3::exceptions::{PyFileNotFoundError, PyMemoryError, PyOSError, PyValueError};
use std::fmt::Display;

/// `FileNotFoundError`; `OSError` for a file that cannot be read or written; `ValueError` for its content;
/// `MemoryError` for a file that needs more memory than there is.
pub(crate) fn file(error: FileError) -> PyErr {
    let text = error.to_string();
    match error.problem {
        _ if error.is_missing() => PyFileNotFoundError::new_err(text),
        Problem::Read(_) | Problem::Write(_) | Problem::InUse => PyOSError::new_err(text),
        Problem::Content(_) => PyValueError::new_err(text),
        Problem::Memory(_) => PyMemoryError::new_err(text),
    }
}

/// `ValueError` for an argument.
pub(crate) fn argument(name: &str, problem: impl Display) -> PyErr {
    PyValueError::new_err(format!("{name}: {problem}"))
}
