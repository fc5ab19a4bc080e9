//! Scenes.

use crate::options::{of_scene, raised, read};
use crate::work::detached;
use opsr::render::Spec;
use opsr::scene::Scene as World;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::CString;
use std::path::PathBuf;

/// A glTF scene, loaded and ready to render. It never changes; several threads may render it.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct Scene {
    pub(crate) world: World,
    /// The path that it was loaded from.
    #[pyo3(get)]
    pub(crate) path: PathBuf,
    /// SHA-256 of the scene's files, in hexadecimal digits.
    #[pyo3(get)]
    pub(crate) sha256: String,
    /// Options that it was loaded with.
    pub(crate) spec: Spec,
    /// Defects and features of the file that are ignored, one line each.
    #[pyo3(get)]
    warnings: Vec<String>,
}

#[pymethods]
impl Scene {
    /// Loads a glTF 2.0 file (.gltf or .glb). Each of its warnings is issued as a UserWarning. Keywords are the options of
    /// `opsr render` for the scene and its light; `help(opsr)` lists them.
    ///
    /// Raises FileNotFoundError or OSError for a file that cannot be read, ValueError for one that is damaged or not
    /// supported.
    #[staticmethod]
    #[pyo3(signature = (path, env=None, **options))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        env: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let keywords = match options {
            Some(options) => options.copy()?,
            None => PyDict::new(py),
        };
        if let Some(env) = env {
            keywords.set_item("env", env)?;
        }
        let spec = read("Scene.load", Some(&keywords), of_scene)?;
        let opened = detached(py, || spec.open(&path, World::new))?.map_err(raised)?;
        for warning in &opened.warnings {
            let text = format!("{}: {warning}", path.display()).replace('\0', " ");
            let text = CString::new(text)?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        Ok(Self {
            world: opened.scene,
            path,
            sha256: opened.sha256,
            spec,
            warnings: opened.warnings,
        })
    }

    /// Names of the cameras, in the order of the file. `render` takes a name or a position in this list.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        let cameras = self.world.parts().cameras.iter();
        cameras.map(|camera| camera.name.clone()).collect()
    }

    fn __repr__(&self) -> String {
        let triangles = self.world.geometry().len();
        format!(
            "<opsr.Scene {}: {triangles} triangles>",
            self.path.display()
        )
    }
}
