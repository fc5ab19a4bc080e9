//! Films: rendered pictures and their statistics.

use crate::array;
use crate::errors::argument;
use crate::options::{of_save, raised, read};
use crate::pickle;
use crate::work::detached;
use opsr::image::Buffer;
use opsr::image::display::auto_exposure;
use opsr::image::exr::{Layer, Metadata};
use opsr::image::film::Film as Moments;
use opsr::image::png;
use opsr::integrator::Picture;
use opsr::pilot::witness::MissingLight;
use opsr::render::Finished;
use opsr::render::value::{Field, Range};
use opsr::resolve::{Resolve, Resolved as Choice, resolve_film, stopping_error};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// The result of a render. Arrays are new ones at every access; rows run from the top.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct Film {
    pub(crate) done: Finished<'static>,
    /// Samples per pixel.
    #[pyo3(get)]
    pub(crate) spp: u32,
    /// Wall time of the render in seconds.
    #[pyo3(get)]
    pub(crate) seconds: f64,
}

#[pymethods]
impl Film {
    /// Text in the file of the picture: a dict of settings by name.
    #[getter]
    fn metadata(&self) -> Metadata {
        self.done.outcome.metadata.clone()
    }

    /// The picture: linear Rec. 709 radiance, shape (height, width, 3), float32. Of several levels the best of every pixel,
    /// denoised where the render was asked to.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::picture(py, self.shown())
    }

    /// Estimated variance of the mean of every pixel, the squared error bar of the picture: radiance squared, shape
    /// (height, width, 3), float32. Of several levels that of level 0, plain path tracing.
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::picture(py, &self.film().variance_of_mean())
    }

    /// The layers that `render` was asked for by `aov`, by name: colours and vectors of shape (height, width, 3), the mesh and
    /// the material of "id" of shape (height, width, 2), other layers of shape (height, width). All float32. "depth" is the
    /// distance in scene units, infinity where there is nothing.
    #[getter]
    fn aovs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let aovs = PyDict::new(py);
        let window = self.film().window;
        let (height, width) = (window.h as usize, window.w as usize);
        for Layer { name, channels } in &self.done.outcome.aovs {
            let name = if name.is_empty() { "alpha" } else { name };
            let count = channels.len();
            let shape = [height, width, count];
            let shape = if count == 1 { &shape[..2] } else { &shape[..] };
            let pixels = 0..height * width;
            let values = pixels.flat_map(|i| channels.iter().map(move |(_, values)| values[i]));
            aovs.set_item(name, array::floats(py, shape, values)?)?;
        }
        Ok(aovs)
    }

    /// Pictures of all levels, plain path tracing first: shape (levels, height, width, 3), float32; None for one level.
    #[getter]
    fn levels<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(film) = &self.made().levels else {
            return Ok(None);
        };
        let window = self.film().window;
        let shape = [film.levels(), window.h as usize, window.w as usize, 3];
        let values = (0..film.levels()).flat_map(|k| film.mean(k).pixels);
        let values = values.flat_map(|p| p.to_array());
        array::floats(py, &shape, values).map(Some)
    }

    /// Samples of every pixel that were not refused: shape (height, width), uint32.
    #[getter]
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let film = &self.film();
        let shape = [film.window.h as usize, film.window.w as usize];
        let counts = film.pixels.iter().map(|m| m.n.to_le_bytes());
        array::array(py, &shape, "<u4", counts)
    }

    /// Samples that were refused because they were not finite.
    #[getter]
    fn rejected(&self) -> u64 {
        self.film().rejected.total()
    }

    /// Average error: the mean relative error to be expected of the picture, as `opsr compare` measures it. Infinity where there
    /// are too few samples.
    #[getter]
    fn mean_relative_error(&self) -> f64 {
        self.done.statement().mean
    }

    /// Root of the relMSE to be expected of the picture; of one level that of its noise alone. Infinity where there are too few
    /// samples.
    #[getter]
    fn relative_error(&self) -> f64 {
        self.done.statement().root
    }

    /// The error that `target_error` bounds: the average error with some doubt, which is larger where samples are few.
    #[getter]
    fn error_bound(&self, py: Python<'_>) -> PyResult<f64> {
        detached(py, || stopping_error(self.made()))
    }

    /// Standard error of the mean of all pixels by channel, before any blur: (red, green, blue). None for several levels, and where
    /// there are too few samples to tell. Unlike `variance` it knows what pixels share by light paths.
    #[getter]
    fn mean_error(&self) -> Option<(f64, f64, f64)> {
        let of_film = || self.film().mean_error().map(|(error, _)| error.into());
        let one = (self.made().levels.as_ref()).is_none_or(|film| film.levels() == 1);
        one.then(of_film).flatten()
    }

    /// Share of the light that the picture lacks at least, as a few roughened paths have found; 0 where they found none, and for
    /// films of several levels and of merged parts, which have no such witness.
    #[getter]
    fn light_missing(&self) -> f64 {
        self.missing().as_ref().map_or(0.0, |missing| missing.share)
    }

    /// (width, height) of the whole frame in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        self.film().size.into()
    }

    /// (x, y, width, height) of the part of the frame that the arrays show, in pixels from the top left.
    #[getter]
    fn crop(&self) -> (u32, u32, u32, u32) {
        let window = self.film().window;
        (window.x, window.y, window.w, window.h)
    }

    /// Writes the picture, whole or not at all: .exr, with variance, AOVs and the choice among levels as layers, or .png. The file
    /// has the bytes of the program's with --reproducible.
    ///
    /// Keywords are the options of `opsr render` for files, such as exposure=1.5 or exr="half"; `help(opsr)` lists them.
    #[pyo3(signature = (path, **options))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let changed = options.map(|options| {
            let mut spec = read("save", Some(options), of_save)?;
            let mut done = self.done.clone();
            done.outcome.spec.fill(&mut spec);
            done.outcome.spec = spec;
            Ok::<_, PyErr>(done)
        });
        let changed = changed.transpose()?;
        let done = changed.as_ref().unwrap_or(&self.done);
        let saved = detached(py, || done.save(&path))?;
        saved.map_err(raised)
    }

    /// The picture as a PNG file in memory, which notebooks show.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        shown(py, self.shown())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        pickle::reduce(slf)
    }

    fn __repr__(&self) -> String {
        let window = self.film().window;
        let (w, h, spp) = (window.w, window.h, self.spp);
        format!("<opsr.Film {w}x{h}, {spp} spp in {:.2} s>", self.seconds)
    }
}

impl Film {
    /// The picture in files and comparisons.
    pub(crate) fn shown(&self) -> &Buffer {
        &self.done.shown.picture
    }

    pub(crate) fn made(&self) -> &Picture {
        &self.done.outcome.picture
    }

    fn film(&self) -> &Moments {
        &self.made().film
    }

    fn missing(&self) -> &Option<MissingLight> {
        &self.done.outcome.missing
    }
}

/// A PNG file at the exposure that suits the picture.
fn shown<'py>(py: Python<'py>, picture: &Buffer) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = detached(py, || png::encode(picture, auto_exposure(picture)))?;
    let bytes = bytes.map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// The level of roughening chosen for every pixel of a film, without a reference.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct Resolved {
    choice: Choice,
}

/// Chooses among the levels of a film again.
///
/// film: a film of several levels.
/// resolve: smoothing that the picture may get, "none", "sharp" or "default".
///
/// Raises ValueError for a film of one level, and for another word.
#[pyfunction]
#[pyo3(signature = (film, *, resolve="default"))]
pub(crate) fn resolve(film: &Bound<'_, Film>, resolve: &str) -> PyResult<Resolved> {
    let settings =
        Resolve::read(&resolve.into(), &Range::FINITE).map_err(|why| argument("resolve", &why))?;
    let Some(levels) = &film.get().made().levels else {
        let what = "a film of one level, there is nothing to choose";
        return Err(argument("film", what));
    };
    let choice = detached(film.py(), || resolve_film(levels, settings))?;
    Ok(Resolved { choice })
}

#[pymethods]
impl Resolved {
    /// The picture: linear Rec. 709 radiance, shape (height, width, 3), float32.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::picture(py, &self.choice.picture)
    }

    /// Chosen level of every pixel: shape (height, width), uint8; 0 is plain path tracing.
    #[getter]
    fn level<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let levels = self.choice.level.iter().map(|&k| [k]);
        array::array(py, &self.shape(), "u1", levels)
    }

    /// Estimated squared bias of every pixel over its squared radiance + 0.01, at a mean radiance of 0.3: shape (height,
    /// width), float32.
    #[getter]
    fn bias2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::floats(py, &self.shape(), self.choice.bias2.iter().copied())
    }

    /// Estimated variance of every pixel, relative as `bias2` is: shape (height, width), float32.
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::floats(py, &self.shape(), self.choice.variance.iter().copied())
    }

    /// Error map, the relative error to be expected of every pixel, whose mean is the average error: shape (height, width), float32.
    #[getter]
    fn error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::floats(py, &self.shape(), self.choice.error())
    }

    /// Average error: the mean relative error to be expected of the picture.
    #[getter]
    fn mean_relative_error(&self) -> f64 {
        self.choice.statement().mean
    }

    /// Root of the relMSE to be expected of the picture: the root mean square of `error`.
    #[getter]
    fn relative_error(&self) -> f64 {
        self.choice.statement().root
    }

    /// The picture as a PNG file in memory, which notebooks show.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        shown(py, &self.choice.picture)
    }
}

impl Resolved {
    fn shape(&self) -> [usize; 2] {
        let Buffer { width, height, .. } = self.choice.picture;
        [height, width]
    }
}
