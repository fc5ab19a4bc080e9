//! Renders, whole or in parts.

use crate::errors::{argument, file};
use crate::film::Film;
use crate::options::{count, of_render, raised, read, threads as threads_of};
use crate::scene::Scene;
use crate::work::{OnEvent, goes_on, watched};
use opsr::image::denoise::Denoiser;
use opsr::image::exr::Metadata;
use opsr::image::film::Window;
use opsr::integrator::Picture;
use opsr::integrator::drive::RenderProgress;
use opsr::integrator::part::{self, MergeError, Merged};
use opsr::render::{Fault, Heading, Outcome, Output, Request, Spec, Subject};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::borrow::Cow;
use std::path::PathBuf;

/// State of a render after a pass.
#[pyclass(frozen, get_all, module = "opsr")]
pub(crate) struct Progress {
    /// Samples per pixel so far.
    samples: u32,
    /// Wall time so far in seconds.
    seconds: f64,
    /// Part of the budget that is spent, from 0 to 1.
    fraction: f64,
}

impl From<RenderProgress> for Progress {
    fn from(progress: RenderProgress) -> Self {
        Self {
            samples: progress.samples,
            seconds: progress.elapsed.as_secs_f64(),
            fraction: progress.fraction.unwrap_or(0.0),
        }
    }
}

/// Options of a function, with those that the scene was loaded with.
fn asked(function: &str, scene: &Scene, options: Option<&Bound<'_, PyDict>>) -> PyResult<Spec> {
    let mut spec = read(function, options, of_render)?;
    scene.spec.fill(&mut spec);
    Ok(spec)
}

/// The scene of a render, whose file has this name.
fn subject<'a>(scene: &'a Scene, name: &'a str) -> Subject<'a> {
    Subject {
        scene: &scene.world,
        name,
        sha256: &scene.sha256,
        in_studio: scene.in_studio,
    }
}

/// The integrator that `render` would take for these options, with the options of its method, as keywords for `render`.
///
/// An integrator that is not named is chosen by the scene's lights and materials and a pilot of a few per cent of the render's work,
/// which is counted, so that every call gives the same. Parts of a render that take these keywords need no pilots of their own:
/// `render(scene, **{**options, **choose(scene, **options)}, part=...)`.
///
/// options: as of `render`, with `spp` those of the whole picture.
#[pyfunction]
#[pyo3(signature = (scene, **options))]
pub(crate) fn choose<'py>(
    scene: &Bound<'py, Scene>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyDict>> {
    let py = scene.py();
    let scene = scene.get();
    let spec = asked("choose", scene, options)?;
    let name = scene.path.display().to_string();
    let mut request = Request::new(&spec, subject(scene, &name), None).map_err(raised)?;
    let chosen = watched::<(), _>(py, None, None, |link| request.choose(&|| !link.stopped()))?;
    // A stopped choice has raised its exception already.
    let _ = chosen.map_err(raised)?;
    let chosen = PyDict::new(py);
    // Resets the caller's options of methods; those of the chosen method follow.
    for (option, _) in spec.given().filter(|(o, _)| o.heading == Heading::Method) {
        chosen.set_item(option.name, py.None())?;
    }
    for (name, text) in request.method_options() {
        let given = options.and_then(|options| options.get_item(name).ok().flatten());
        match given.filter(|_| name != "integrator") {
            Some(given) => chosen.set_item(name, given)?,
            None => chosen.set_item(name, text)?,
        }
    }
    Ok(chosen)
}

/// Renders a scene; `opsr/__init__.py` says more.
#[pyfunction]
#[pyo3(signature = (scene, *, on_progress=None, threads=None, part=None, samples=None, begun=None, **options))]
pub(crate) fn render(
    scene: &Bound<'_, Scene>,
    on_progress: Option<Py<PyAny>>,
    threads: Option<&Bound<'_, PyAny>>,
    part: Option<PathBuf>,
    samples: Option<&Bound<'_, PyAny>>,
    begun: Option<PathBuf>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Option<Film>> {
    let py = scene.py();
    let scene = scene.get();
    let spec = asked("render", scene, options)?;
    let threads = threads_of(threads)?;
    if part.is_some() {
        Request::check_part(&spec).map_err(raised)?;
    }
    let name = scene.path.display().to_string();
    let mut request = Request::new(&spec, subject(scene, &name), None).map_err(raised)?;
    let denoiser = spec.denoiser().map_err(raised)?;
    let mut on_event = on_progress.map(|call| {
        move |py: Python<'_>, progress: RenderProgress| {
            let answer = call.call1(py, (Progress::from(progress),))?;
            Ok(goes_on(answer.bind(py)))
        }
    });
    let on_event: OnEvent<'_, RenderProgress> = on_event.as_mut().map(|on_event| on_event as _);
    if let Some(path) = part {
        let samples = samples.map(range).transpose()?;
        let done = watched(py, threads, on_event, |link| {
            let listen = &mut |progress: &RenderProgress| link.tell(|| *progress);
            if request.choose(&|| !link.stopped())?.is_break() {
                return Ok(false);
            }
            request.part(&path, samples, begun.as_deref(), listen)
        })?;
        return match done.map_err(raised)? {
            true => Ok(None),
            false => Err(argument("part", "not written, since on_progress ended it")),
        };
    }
    for (name, given) in [("samples", samples.is_some()), ("begun", begun.is_some())] {
        if given {
            return Err(argument(name, "needs a part to write"));
        }
    }
    let made = watched(py, threads, on_event, |link| {
        let begun = request.begin(&|| !link.stopped())?;
        let Some(begun) = begun else {
            return Ok(None);
        };
        let listen = &mut |progress: &RenderProgress, _: &Picture| link.tell(|| *progress);
        let output = request.render(begun, Some(&link.stop), listen);
        film(&request, output, denoiser.as_ref()).map(Some)
    })?;
    // A stopped pilot has raised its exception already, as after Ctrl-C.
    made.map_err(raised)
}

/// The film of a render that has ended.
fn film(request: &Request<'_>, output: Output, denoiser: Option<&Denoiser>) -> Result<Film, Fault> {
    let samples = output.progress.samples;
    let picture = Cow::Owned(output.picture);
    let outcome = Outcome::of(request, picture, samples, output.missing);
    Ok(Film {
        done: outcome.finish(denoiser)?,
        spp: samples,
        seconds: output.progress.elapsed.as_secs_f64(),
    })
}

/// A range of samples: the first, and the one after the last.
fn range(samples: &Bound<'_, PyAny>) -> PyResult<std::ops::Range<u32>> {
    let pair = samples.extract::<(u32, u32)>().ok();
    let pair = pair.filter(|(start, end)| start < end);
    let (start, end) = pair.ok_or_else(|| argument("samples", "expected (first, last + 1)"))?;
    Ok(start..end)
}

/// Adds the numbers that are known at the end of a render.
fn stamp(metadata: &mut Metadata, samples: u32, picture: &Picture) {
    metadata.insert("spp".into(), samples.to_string());
    let refused = picture.film.rejected.total();
    metadata.insert("refused_samples".into(), refused.to_string());
}

/// Puts the parts of a render together, in any order: the film is that of the single render, bit by bit.
///
/// parts: files that `render(..., part=...)` or the program wrote.
/// spp: samples per pixel that the parts shall make; by default the most that a pixel has.
/// crop: (x, y, width, height) of the pixels that the parts shall make; by default the whole frame.
/// partial: True for the picture so far: pixels may lack samples, and are black without any.
///
/// Raises ValueError for parts of different renders, for samples that are missing or there twice, each by name, and for
/// damaged files; OSError for those that cannot be read.
#[pyfunction]
#[pyo3(signature = (parts, *, spp=None, crop=None, partial=false))]
pub(crate) fn merge(
    py: Python<'_>,
    parts: Vec<PathBuf>,
    spp: Option<&Bound<'_, PyAny>>,
    crop: Option<&Bound<'_, PyAny>>,
    partial: bool,
) -> PyResult<Film> {
    let spp = count("spp", spp, 1)?;
    let crop = crop.map(|crop| {
        let keywords = PyDict::new(py);
        keywords.set_item("crop", crop)?;
        read("merge", Some(&keywords), |option| option.name == "crop")
    });
    let crop = crop.transpose()?.and_then(|spec: Spec| spec.crop);
    let window = |size| crop.map_or(Window::full(size), |crop| crop.of(size));
    let merged = watched::<(), _>(py, None, None, |_| match partial {
        true => part::merge(&parts, window, None, false),
        false => part::merge(&parts, window, spp, true),
    })?;
    let Merged {
        first,
        samples,
        picture,
    } = merged.map_err(|error| match error {
        MergeError::File(error) => file(error),
        MergeError::Memory(shortage) => PyMemoryError::new_err(shortage.to_string()),
        MergeError::Samples(what) => argument("parts", what),
    })?;
    let wanted = first.layers.iter().map(|name| name.parse());
    let wanted = wanted.collect::<Result<Vec<_>, _>>();
    let wanted = wanted.map_err(|e| argument("parts", e))?;
    let mut metadata = first.metadata;
    stamp(&mut metadata, samples, &picture);
    // Without a witness, which needs the scene.
    let outcome = Outcome::of_film(
        &Spec::default(),
        picture,
        &wanted,
        metadata,
        Some(first.camera),
    )
    .map_err(raised)?;
    Ok(Film {
        done: outcome.finish(None).map_err(raised)?,
        spp: samples,
        seconds: 0.0,
    })
}
