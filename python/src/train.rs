//! Training.

use crate::errors::{argument, file};
use crate::options::threads as threads_of;
use crate::table::{Table, json};
use crate::work::{Link, OnEvent, goes_on, watched};
use opsr::files::create_folder;
use opsr::regularise::file::TableFile;
use opsr_train::config::{Config, ConfigError, Preset};
use opsr_train::record::crop::DatasetError;
use opsr_train::{RecordingControl, Recordings, Session, TrainError};
use pyo3::exceptions::{PyFileNotFoundError, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
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
/// config: settings as a dict, such as `{"preset": "smoke", "seed": 1}`, or a TOML file of them, on top of those of a preset:
///     "full" by default, as in the program, "published", "fast" or "smoke". docs/training.md lists presets and keys;
///     "manifest" names the file that lists the scenes, by default training_scenes/manifest.toml in the working directory.
/// on_step: called with a Step at every step; False ends the training.
/// recordings: a folder that `record` filled with the same settings: all of its recordings are there, and no others.
/// threads: their number; all cores by default. The tables do not depend on it.
///
/// Returns the tables in the order of beta, after `False` those so far.
///
/// Ctrl-C ends the recording or the training within a second or at the next step, and raises KeyboardInterrupt. Raises
/// ValueError for settings and scenes that cannot be used, FileNotFoundError and OSError for files, RuntimeError for a
/// training without usable gradients.
#[pyfunction]
#[pyo3(signature = (config=None, *, on_step=None, recordings=None, threads=None))]
pub(crate) fn train(
    py: Python<'_>,
    config: Option<&Bound<'_, PyAny>>,
    on_step: Option<Py<PyAny>>,
    recordings: Option<PathBuf>,
    threads: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Table>> {
    let config = settings(config)?;
    let mut on_event = on_step.map(|call| {
        move |py: Python<'_>, (beta, step, loss, log): Event| {
            let log = log.map(|log| json(py, log)).transpose()?;
            let step = Step {
                beta: shortest(beta),
                step,
                loss,
                log: log.map(Bound::unbind),
            };
            let answer = call.call1(py, (step,))?;
            Ok(goes_on(answer.bind(py)))
        }
    });
    let on_event: OnEvent<'_, Event> = on_event.as_mut().map(|on_event| on_event as _);
    let tables = watched(py, threads_of(threads)?, on_event, |link| {
        let mut session = Session::open(config, &control(recordings, link))?;
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

/// Recordings in memory, or in this folder.
fn control<E>(folder: Option<PathBuf>, link: &Link<E>) -> RecordingControl<'static> {
    RecordingControl {
        complete: folder.is_some(),
        folder,
        stop: link.stop.clone(),
        ..RecordingControl::default()
    }
}

/// Traces the paths of a training before it, for instance each crop on another machine, into files for
/// `train(..., recordings=...)`. Those that are there whole are kept.
///
/// config: settings as of `train`; beta, optimiser and steps do not matter.
/// folder: the folder of the recordings.
/// crops: (first, last + 1) of the crops to record; all by default.
/// threads: their number; all cores by default. The recordings do not depend on it.
///
/// Returns all crops in order, as dicts of the "file" in the folder, "scene", "family" and "training" (False for those that
/// are only scored); `crops=(0, 0)` records none.
///
/// Ctrl-C ends it within a second and raises KeyboardInterrupt; crops that are done are kept. Raises what `train` raises.
#[pyfunction]
#[pyo3(signature = (config, folder, *, crops=None, threads=None))]
pub(crate) fn record<'py>(
    py: Python<'py>,
    config: Option<&Bound<'py, PyAny>>,
    folder: PathBuf,
    crops: Option<(usize, usize)>,
    threads: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let config = settings(config)?;
    let crops = watched::<(), _>(py, threads_of(threads)?, None, |link| {
        let recordings = Recordings::open(config).map_err(failed)?;
        let names = recordings.names();
        let (first, end) = crops.unwrap_or((0, names.len()));
        if first > end || end > names.len() {
            let what = format!("expected (first, last + 1) of {} crops", names.len());
            return Err(argument("crops", what));
        }
        create_folder(&folder).map_err(file)?;
        let control = RecordingControl {
            complete: false,
            ..control(Some(folder), link)
        };
        recordings.record(first..end, &control).map_err(failed)?;
        let crops = recordings.crops().zip(names).map(|((crop, training), file)| {
            json!({ "file": file, "scene": crop.scene_name, "family": crop.family, "training": training })
        });
        Ok(crops.collect::<Vec<_>>())
    })??;
    json(py, serde_json::to_string(&crops))
}

/// The shortest decimal that reads back as this single, as a double.
fn shortest(beta: f32) -> f64 {
    beta.to_string().parse().unwrap_or(f64::from(beta))
}

/// The settings of a dict or a file, on top of those of a preset.
fn settings(config: Option<&Bound<'_, PyAny>>) -> PyResult<Config> {
    let Some(config) = config else {
        return Ok(Preset::default().into());
    };
    let Ok(settings) = config.cast::<PyDict>() else {
        let path: PathBuf = config.extract()?;
        let preset = Config::from(Preset::default());
        return preset.with_file(&path).map_err(|e| failed(e.into()));
    };
    let py = config.py();
    let words = PyDict::new(py);
    words.set_item("allow_nan", false)?;
    words.set_item("default", py.import("os")?.getattr("fspath")?)?;
    let text = py.import("json")?;
    let text: String = text
        .call_method("dumps", (settings,), Some(&words))?
        .extract()?;
    let mut table: toml::Table = serde_json::from_str(&text).map_err(|e| argument("config", e))?;
    let preset = table.remove("preset").map(toml::Value::try_into::<Preset>);
    let preset = preset
        .transpose()
        .map_err(|e| argument("config", format!("preset: {}", e.to_string().trim())))?;
    let text = toml::to_string(&table).map_err(|e| argument("config", e))?;
    Config::from(preset.unwrap_or_default())
        .with_text(&text, "config")
        .map_err(|e| failed(e.into()))
}

fn failed(error: TrainError) -> PyErr {
    let text = error.to_string();
    match error {
        TrainError::Config(ConfigError::File(e))
        | TrainError::Dataset(DatasetError::File(e))
        | TrainError::Checkpoint(e) => file(e),
        TrainError::Dataset(DatasetError::Missing { .. } | DatasetError::Unrecorded { .. }) => {
            PyFileNotFoundError::new_err(text)
        }
        TrainError::Memory(_) => PyMemoryError::new_err(text),
        TrainError::State(_) | TrainError::NotFinite { .. } => PyRuntimeError::new_err(text),
        _ => PyValueError::new_err(text),
    }
}
