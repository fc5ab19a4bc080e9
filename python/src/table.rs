//! Tables of attenuation factors.

use crate::array;
use crate::errors::{argument, file};
use opsr::files::hex;
use opsr::regularise::file::{TableFile, save as save_table};
use opsr::regularise::{Attenuation, AttenuationTable, LEN, Lookup, PathRoughness};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A table of 1360 attenuation factors, one for each class of path.
///
/// gammas: the factors, shape (1360,), from 0 to 1. Classes are ordered by the number of vertices: 16 of two, 64 of three,
/// 256 of four, 1024 of five; then by the roughness bins of the vertices as digits of base 4, the vertex nearest the camera
/// first. So `table.gammas[:16].reshape(4, 4)` has the factors of two vertices, rows by the first, columns by the last.
/// interpolation: "nearest" or "linear", the look-up.
/// scale: multiplier of every factor, above 0; products are clamped to 1.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct Table {
    pub(crate) file: TableFile,
}

#[pymethods]
impl Table {
    #[new]
    #[pyo3(signature = (gammas, *, interpolation="nearest", scale=1.0))]
    fn new(gammas: &Bound<'_, PyAny>, interpolation: &str, scale: f32) -> PyResult<Self> {
        let (shape, gammas) = array::to_floats(gammas)?;
        if shape != [LEN] {
            let what = format!("expected {LEN} numbers, got shape {shape:?}");
            return Err(argument("gammas", what));
        }
        if let Some(i) = gammas.iter().position(|g| !(0.0..=1.0).contains(g)) {
            let what = format!("{} is outside [0, 1]", gammas[i]);
            return Err(argument(&format!("gammas[{i}]"), what));
        }
        let lookup = match interpolation {
            "nearest" => Lookup::Nearest,
            "linear" => Lookup::Linear,
            _ => return Err(argument("interpolation", "expected nearest or linear")),
        };
        let mut table = AttenuationTable::constant(0.0);
        table.gammas.copy_from_slice(&gammas);
        (table.lookup, table.scale) = (lookup, positive("scale", scale)?);
        Ok(Self::of(table))
    }

    /// Reads a table file; "beta-0.001" and "beta-0.05" are tables that the package contains.
    ///
    /// Raises FileNotFoundError, OSError, or ValueError for a file that is no table.
    #[staticmethod]
    pub(crate) fn load(path: PathBuf) -> PyResult<Self> {
        let file = TableFile::load(&path).map_err(|e| file(e.into()))?;
        Ok(Self { file })
    }

    /// A table with the same factor, from 0 to 1, for all paths.
    #[staticmethod]
    fn constant(gamma: f32) -> PyResult<Self> {
        let gamma = unit("gamma", gamma)?;
        Ok(Self::of(AttenuationTable::constant(gamma)))
    }

    /// Writes the table file, whole or not at all.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        save_table(&self.file, &path).map_err(file)
    }

    /// The attenuation factor of paths, scale included.
    ///
    /// alphas: Beckmann roughness, from 0 to 1, of the vertices of a path, camera first; the last is the one where light is
    /// sampled. Shape (n,) for one path of n >= 2 vertices, or (m, n) for m of them.
    ///
    /// Returns a float, or an array of shape (m,), float32.
    fn lookup<'py>(&self, alphas: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = alphas.py();
        let (shape, values) = array::to_floats(alphas)?;
        let &n = shape.last().unwrap_or(&0);
        if n < 2 || shape.len() > 2 {
            let what = format!("expected two vertices or more for each path, got shape {shape:?}");
            return Err(argument("alphas", what));
        }
        if let Some(alpha) = values.iter().find(|a| !(0.0..=1.0).contains(*a)) {
            return Err(argument("alphas", format!("{alpha} is outside [0, 1]")));
        }
        let table = &self.file.table;
        let gamma = |path: &[f32]| {
            let (prefix, last) = path.split_at(n - 1);
            table.gamma(&PathRoughness::of(prefix, table), last[0])
        };
        if shape.len() == 1 {
            return Ok(gamma(&values).into_pyobject(py)?.into_any());
        }
        array::floats(py, &shape[..1], values.chunks_exact(n).map(gamma))
    }

    /// This table with its factors multiplied by `scale`, above 0.
    fn tuned(&self, scale: f32) -> PyResult<Self> {
        let mut file = self.file.clone();
        file.table.scale = positive("scale", file.table.scale * positive("scale", scale)?)?;
        Ok(Self { file })
    }

    /// The factors before the scale, in class order: a new array of shape (1360,), float32.
    #[getter]
    fn gammas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::floats(py, &[LEN], self.file.table.gammas.iter().copied())
    }

    /// Look-up: "nearest" or "linear".
    #[getter]
    fn interpolation(&self) -> &'static str {
        match self.file.table.lookup {
            Lookup::Nearest => "nearest",
            Lookup::Linear => "linear",
        }
    }

    /// Multiplier of every factor.
    #[getter]
    fn scale(&self) -> f32 {
        self.file.table.scale
    }

    /// SHA-256 of factors, scale and look-up, in hexadecimal digits.
    #[getter]
    fn sha256(&self) -> String {
        hex(&self.file.digest())
    }

    /// Record of the training as a dict; None for a table made by hand.
    #[getter]
    fn provenance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, serde_json::to_string(&self.file.provenance))
    }

    fn __repr__(&self) -> String {
        let kind = match &self.file.provenance {
            Some(training) => format!("learned with beta {}", training.beta as f32),
            None => "made by hand".to_owned(),
        };
        let (lookup, scale) = (self.interpolation(), self.scale());
        format!("<opsr.Table {kind}, {lookup}, scale {scale}>")
    }
}

impl Table {
    fn of(table: AttenuationTable) -> Self {
        let provenance = None;
        let file = TableFile { table, provenance };
        Self { file }
    }
}

/// A number from 0 to 1.
pub(crate) fn unit(name: &str, x: f32) -> PyResult<f32> {
    match (0.0..=1.0).contains(&x) {
        true => Ok(x),
        false => Err(argument(name, "expected a number from 0 to 1")),
    }
}

/// A number above 0.
pub(crate) fn positive(name: &str, x: f32) -> PyResult<f32> {
    match x > 0.0 && x.is_finite() {
        true => Ok(x),
        false => Err(argument(name, "expected a number above 0")),
    }
}

/// JSON as Python's own objects.
pub(crate) fn json(py: Python<'_>, text: serde_json::Result<String>) -> PyResult<Bound<'_, PyAny>> {
    let text = text.map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}
