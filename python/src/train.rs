//! Training.

use crate::errors::{argument, file};
use crate::table::{Table, json};
use crate::work::{Hear, watched};
use opsr::regularise::file::TableFile;
use opsr::train::config::{Config, ConfigError};
use opsr::train::record::crop::DatasetError;
use opsr::train::{RecordingControl, Session, TrainError};
use pyo3::exceptions::{PyFileNotFoundError, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use std::path::PathBuf;

/// A step of a training.
#[pyclass(frozen, get_all, module = "opsr")]
pub(crate) struct Step {
    /// Weight of the variance in the loss of this table.
    beta: f64,
    /// Steps taken.
    step: u32,
    /// Mean loss of the training crops; not a number at the end, where there is only a validation.
    loss: f32,
    /// The line of the log of a step with a validation, a dict as in metrics.jsonl; otherwise None.
    log: Option<Py<PyAny>>,
}

/// β, step, loss and the log's line in JSON.
type Event = (f32, u32, f32, Option<serde_json::Result<String>>);

/// Learns a table for each beta of a configuration: those that `opsr train` writes for it.
///
/// config: settings as a dict, such as `{"scenes": ["cornell_caustics"], "spp": 256, "steps": 150, "optimiser": "log",
///     "start": 0.0}`, or a TOML file of them. docs/training.md lists keys and defaults; "manifest" names the file that lists
///     the scenes, by default training_scenes/manifest.toml in the working directory.
/// on_step: called with a Step at every step; False ends the training.
/// threads: their number; all cores by default. The tables do not depend on it.
///
/// Returns the tables in the order of beta, after `False` those so far.
///
/// Ctrl-C ends the recording or the training within a second or at the next step, and raises KeyboardInterrupt. Raises
/// ValueError for settings and scenes that cannot be used, FileNotFoundError and OSError for files, RuntimeError for a
/// training without usable gradients.
#[pyfunction]
#[pyo3(signature = (config=None, *, on_step=None, threads=None))]
pub(crate) fn train(
    py: Python<'_>,
    config: Option<&Bound<'_, PyAny>>,
    on_step: Option<Py<PyAny>>,
    threads: Option<u16>,
) -> PyResult<Vec<Table>> {
    let config = config.map(settings).transpose()?.unwrap_or_default();
    let mut hear = on_step.map(|call| {
        move |py: Python<'_>, (beta, step, loss, log): Event| {
            let log = log.map(|log| json(py, log)).transpose()?;
            let step = Step {
                // The shortest number, not the nearest double of the single.
                beta: beta.to_string().parse().unwrap_or(f64::from(beta)),
                step,
                loss,
                log: log.map(Bound::unbind),
            };
            let answer = call.call1(py, (step,))?;
            Ok(!answer.bind(py).is(PyBool::new(py, false)))
        }
    });
    let hear: Hear<'_, Event> = hear.as_mut().map(|hear| hear as _);
    let tables = watched(py, threads, hear, |link| {
        let control = RecordingControl {
            stop: link.stop.clone(),
            ..RecordingControl::default()
        };
        let mut session = Session::open(config, &control)?;
        let mut tables = Vec::new();
        for beta in session.config.beta.clone() {
            let outcome = session.learn(beta, None, false, &mut |step, loss, entry| {
                link.tell(|| (beta, step, loss, entry.map(serde_json::to_string)))
            })?;
            let provenance = Some(session.provenance(beta, outcome.start, outcome.steps));
            let table = outcome.table;
            let file = TableFile { table, provenance };
            tables.push(Table { file });
            if outcome.stopped {
                break;
            }
        }
        Ok(tables)
    })?;
    tables.map_err(failed)
}

/// The settings of a dict or a file.
fn settings(config: &Bound<'_, PyAny>) -> PyResult<Config> {
    let default = Config::default();
    if !config.is_instance_of::<PyDict>() {
        let path: PathBuf = config.extract()?;
        return default.with_file(&path).map_err(|e| failed(e.into()));
    }
    let py = config.py();
    let words = PyDict::new(py);
    words.set_item("allow_nan", false)?;
    words.set_item("default", py.import("os")?.getattr("fspath")?)?;
    let text = py.import("json")?;
    let text: String = text
        .call_method("dumps", (config,), Some(&words))?
        .extract()?;
    let table: toml::Table = serde_json::from_str(&text).map_err(|e| argument("config", e))?;
    let text = toml::to_string(&table).map_err(|e| argument("config", e))?;
    (default.with_text(&text, "config")).map_err(|e| failed(e.into()))
}

fn failed(error: TrainError) -> PyErr {
    let text = error.to_string();
    match error {
        TrainError::Config(ConfigError::File(e))
        | TrainError::Dataset(DatasetError::File(e))
        | TrainError::Checkpoint(e) => file(e),
        TrainError::Dataset(DatasetError::Missing { .. }) => PyFileNotFoundError::new_err(text),
        TrainError::Memory(_) => PyMemoryError::new_err(text),
        TrainError::State(_) | TrainError::NotFinite { .. } => PyRuntimeError::new_err(text),
        _ => PyValueError::new_err(text),
    }
}
