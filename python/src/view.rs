//! A viewer in a notebook: the page of `opsr view`, served by threads of this process.

use crate::options::{of_view, raised, read};
use crate::scene::Scene;
use opsr_view::Viewer;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A page that shows a scene while it is rendered. It is open until `close` or until the object is gone.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct View {
    /// Address of the page, on this machine only.
    #[pyo3(get)]
    address: String,
    height: u32,
    stop: Arc<AtomicBool>,
}

#[pymethods]
impl View {
    /// Ends the page.
    fn close(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// The page in a cell of a notebook.
    fn _repr_html_(&self) -> String {
        let Self {
            address, height, ..
        } = self;
        format!(
            "<iframe src=\"{address}\" title=\"opsr\" width=\"100%\" height=\"{height}\" style=\"border:0\" allow=\"clipboard-write\"></iframe>"
        )
    }

    fn __repr__(&self) -> String {
        format!("<opsr.View {}>", self.address)
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.close();
    }
}

/// Shows a scene on a page; `opsr/__init__.py` says more.
#[pyfunction]
#[pyo3(signature = (scene, *, port=0, height=640, reference=None, **options))]
pub(crate) fn view(
    scene: &Bound<'_, PyAny>,
    port: u16,
    height: u32,
    reference: Option<PathBuf>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<View> {
    let mut spec = read("view", options, of_view)?;
    let path = match scene.cast::<Scene>() {
        Ok(scene) => {
            // The scene has options of its own, with which it was loaded.
            scene.get().spec.fill(&mut spec);
            scene.get().path.clone()
        }
        Err(_) => scene.extract()?,
    };
    let viewer = Viewer::open(&path, &spec, port, reference.as_deref()).map_err(raised)?;
    let address = viewer.address();
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    // Errors are shown on the page.
    std::thread::spawn(move || viewer.run(&flag));
    Ok(View {
        address,
        height,
        stop,
    })
}
