//! Benches.

use crate::errors::{argument, file};
use crate::options::threads as threads_of;
use crate::table::json;
use crate::work::{OnEvent, goes_on, watched};
use opsr_lab::report::bench::{BenchError, Outcome, Status, Suite, run};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Measures methods against each other, as `opsr bench` does.
///
/// suite: a TOML file of scenes, methods, seeds and time points; `opsr bench --help` shows one.
/// output: file of the results (.json), for `opsr report`. Measurements that it already holds are kept; pictures and references
///     are kept in a folder beside it.
/// scenes: names of the scenes to measure; all by default.
/// on_progress: called with (what is measured, runs done, runs in all) after each pass, outside of the time that is measured;
///     False ends the bench, whose results so far are in the file.
/// threads: their number; all cores by default.
///
/// Returns the results as a dict: "cells" has the errors of each run of a method on a scene with a seed.
///
/// Ctrl-C ends it after the current pass and raises KeyboardInterrupt. Raises ValueError for a suite or scene that cannot be
/// used, FileNotFoundError and OSError for files.
#[pyfunction]
#[pyo3(signature = (suite, output, *, scenes=None, on_progress=None, threads=None))]
pub(crate) fn bench<'py>(
    py: Python<'py>,
    suite: PathBuf,
    output: PathBuf,
    scenes: Option<Vec<String>>,
    on_progress: Option<Py<PyAny>>,
    threads: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let whole = Suite::load(&suite).map_err(file)?;
    let mut suite = whole.clone();
    if let Some(names) = scenes {
        if let Some(name) = (names.iter()).find(|n| !whole.scenes.iter().any(|s| s.name == **n)) {
            return Err(argument("scenes", format!("no scene `{name}`")));
        }
        suite.scenes.retain(|scene| names.contains(&scene.name));
    }
    let mut on_event = on_progress.map(|call| {
        move |py: Python<'_>, (what, done, total): (String, usize, usize)| {
            let answer = call.call1(py, (what, done, total))?;
            Ok(goes_on(answer.bind(py)))
        }
    });
    let on_event: OnEvent<'_, (String, usize, usize)> =
        on_event.as_mut().map(|on_event| on_event as _);
    let results = watched(py, threads_of(threads)?, on_event, |link| {
        let listener =
            &mut |status: &Status| link.tell(|| (status.what.clone(), status.done, status.total));
        let (mut results, outcome) = run(&suite, &output, "opsr.bench", listener)?;
        if outcome == Outcome::Done {
            results.suite = whole;
            results.save(&output)?;
        }
        Ok(results)
    })?;
    let results = results.map_err(|error| match error {
        BenchError::File(error) => file(error),
        fault => PyValueError::new_err(fault.to_string()),
    })?;
    json(py, serde_json::to_string(&results))
}
