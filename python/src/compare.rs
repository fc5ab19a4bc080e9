//! Metrics.

use crate::array;
use crate::errors::{argument, file};
use crate::film::Film;
use crate::work::detached;
use opsr_lab::report::compare::{Named, Options, compare as metrics};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Errors of a picture against its reference: a dict of metrics by name, such as "MSE", "relMSE", "MAPE", "FLIP" and
/// "HDR-FLIP", in the order of `opsr compare`. HDR-FLIP is left out for pictures of files that are not EXR and for a black
/// reference.
///
/// picture, reference: linear Rec. 709 radiance as arrays of shape (height, width, 3), float32; films; or files (.exr, .png,
/// .jpg). Both have the same size and only finite pixels.
/// ppd: pixels per degree of sight, for FLIP.
/// exposure: stops by which pictures are brightened for FLIP.
///
/// Raises TypeError for arrays of another type, ValueError for pictures that cannot be compared.
#[pyfunction]
#[pyo3(signature = (picture, reference, *, ppd=None, exposure=0.0))]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    picture: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    ppd: Option<f64>,
    exposure: f32,
) -> PyResult<Bound<'py, PyDict>> {
    if !exposure.is_finite() {
        return Err(argument("exposure", "expected a number of stops"));
    }
    let mut options = Options::default();
    options.ppd = ppd.unwrap_or(options.ppd);
    options.exposure = exposure;
    let pictures = [named("picture", picture)?];
    let reference = named("reference", reference)?;
    let comparison = detached(py, || metrics(&pictures, &reference, &options))?;
    let comparison = comparison.map_err(|e| PyValueError::new_err(e.to_string()))?;
    let all = PyDict::new(py);
    for metric in comparison.metrics() {
        all.set_item(metric.name, metric.value)?;
    }
    Ok(all)
}

fn named(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Named> {
    let picture = if let Ok(film) = value.cast::<Film>() {
        film.get().shown().clone()
    } else if let Ok(path) = value.extract::<PathBuf>() {
        return detached(value.py(), || Named::load(&path))?.map_err(file);
    } else {
        array::to_picture(name, value)?
    };
    Ok(Named::new(name, picture, true))
}
