//! Renders.

use crate::errors::argument;
use crate::film::Film;
use crate::scene::Scene;
use crate::table::{Table, unit};
use crate::work::{Hear, watched};
use opsr::image::exr::Metadata;
use opsr::image::film::{Film as Moments, Window};
use opsr::image::level_film::{LevelFilm, MAX_LEVELS};
use opsr::integrator::drive::{Budget, RenderProgress, drive};
use opsr::integrator::levels::SCALES;
use opsr::integrator::method::{Kind, MethodSpec};
use opsr::integrator::{FirstHit, Picture, Settings, View};
use opsr::math::UVec2;
use opsr::memory;
use opsr::regularise::{Rule, TableTuning};
use opsr::tune::resolve::resolve_film;
use pyo3::exceptions::{PyMemoryError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyInt;
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

/// Samples per pixel of a render without a budget.
const DEFAULT_SPP: u32 = 128;

/// Bytes of a pixel, of its AOVs and of each level, as the program counts them.
const PIXEL_BYTES: u64 = 205;
const AOV_BYTES: u64 = 195;
const LEVEL_BYTES: u64 = 96;

/// Rows of a picture without a size.
const DEFAULT_ROWS: u32 = 512;

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

/// Renders a scene. The same settings give the same picture as the program, at any number of threads.
///
/// scene: the scene.
/// camera: name or number; by default the first, or one that sees the whole scene.
/// size: (width, height) of the whole frame in pixels, at most 65536 each; by default 512 rows, as wide as the camera asks
///     for.
/// crop: (x, y, width, height) of the part to render, in pixels from the top left.
/// spp, time: when to stop, in samples per pixel or in seconds, the first one reached; 128 samples by default.
/// seed: seed of all random numbers, from 0 to 2**64 - 1.
/// table: learned attenuation factors: a Table, a file, or "beta-0.001" or "beta-0.05".
/// gamma: one attenuation factor from 0 to 1 for all paths, instead of a table.
/// rule: a rule of other renderers instead of both, for comparison: "pbrt", "filter-glossy", "roughness-clamp" or
///     "mollifier".
/// reuse: continue paths with the roughened lobe; needs a table or gamma.
/// integrator: "path", "light", "bdpt", "vcm" or "sppm"; only the first takes a rule or reuse, "bdpt" and "vcm" a
///     table or gamma too, and "bdpt" the mollifier.
/// levels: several amounts of roughening on the same paths, of which every pixel gets the best: their number from 1 to 8, or
///     the scales of the table's or the constant factor, ascending from 0. One by default, where the program has five.
/// max_vertices: scattering vertices of the longest path, from 1 to 65536.
/// threads: their number; all cores by default.
/// aov: record albedo, normal and depth of the first surface.
/// on_progress: called with a Progress after each pass; False ends the render, which then has the samples so far.
///
/// Ctrl-C ends the render after the current pass and raises KeyboardInterrupt. Raises ValueError for settings that cannot
/// be, MemoryError for pictures that are too large for this machine.
#[pyfunction]
#[pyo3(signature = (
    scene, *, camera=None, size=None, crop=None, spp=None, time=None, seed=0, table=None, gamma=None, rule=None,
    reuse=false, integrator="path", levels=None, max_vertices=16, threads=None, aov=false, on_progress=None
))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn render(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    camera: Option<&Bound<'_, PyAny>>,
    size: Option<(u32, u32)>,
    crop: Option<(u32, u32, u32, u32)>,
    spp: Option<u32>,
    time: Option<f64>,
    seed: u64,
    table: Option<&Bound<'_, PyAny>>,
    gamma: Option<f32>,
    rule: Option<&str>,
    reuse: bool,
    integrator: &str,
    levels: Option<&Bound<'_, PyAny>>,
    max_vertices: u32,
    threads: Option<u16>,
    aov: bool,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Film> {
    let scene = scene.get();
    let frame = frame(scene, camera, size)?;
    let camera = scene.camera(camera, frame.x as f32 / frame.y as f32)?;
    let budget = budget(spp, time)?;
    if !(1..=65536).contains(&max_vertices) {
        return Err(argument("max_vertices", "expected 1 to 65536"));
    }
    let table = table.map(held).transpose()?;
    let (mut settings, digest) = method(table.as_ref(), gamma, rule, reuse, integrator)?;
    (settings.max_vertices, settings.seed) = (max_vertices, seed);
    settings.levels = levels.map(scales).transpose()?.unwrap_or_default();
    let fault = |e| argument("levels", e);
    settings.check_levels().map_err(fault)?;
    let fault = |e| argument("integrator", e);
    settings.check_scene(&scene.world, &camera).map_err(fault)?;
    let window = crop.map_or(Window::full(frame), |(x, y, w, h)| Window { x, y, w, h });
    let mut picture = empty(frame, window, crop.is_some(), &settings, aov)?;

    let mut hear = on_progress.map(|call| {
        move |py: Python<'_>, progress: RenderProgress| {
            let answer = call.call1(py, (Progress::from(progress),))?;
            Ok(!answer.bind(py).is(pyo3::types::PyBool::new(py, false)))
        }
    });
    let hear: Hear<'_, RenderProgress> = hear.as_mut().map(|hear| hear as _);
    let (made, choice, progress) = watched(py, threads, hear, |link| {
        let view = View::new(&scene.world, &camera, frame, window);
        let (progress, _) = drive(
            &mut *settings.integrator(),
            &view,
            &budget,
            0,
            &mut picture,
            &mut |progress, _| link.tell(|| *progress),
        );
        let choice = (picture.levels.as_ref()).map(|film| resolve_film(film, false));
        (picture, choice, progress)
    })?;
    Ok(Film {
        made,
        choice,
        metadata: metadata(scene, &settings, digest, progress.samples),
        spp: progress.samples,
        seconds: progress.elapsed.as_secs_f64(),
    })
}

/// Size of the whole frame.
fn frame(
    scene: &Scene,
    camera: Option<&Bound<'_, PyAny>>,
    size: Option<(u32, u32)>,
) -> PyResult<UVec2> {
    let allowed = 1..=65536;
    match size {
        Some((w, h)) if allowed.contains(&w) && allowed.contains(&h) => Ok(UVec2::new(w, h)),
        Some(_) => {
            let what = "expected (width, height), such as (640, 480), from 1 to 65536 each";
            Err(argument("size", what))
        }
        None => {
            let aspect = scene.camera(camera, 1.0)?.aspect.unwrap_or(1.0);
            let width = (DEFAULT_ROWS as f32 * aspect).round() as u32;
            Ok(UVec2::new(width.clamp(1, 16 * DEFAULT_ROWS), DEFAULT_ROWS))
        }
    }
}

fn budget(spp: Option<u32>, time: Option<f64>) -> PyResult<Budget> {
    if spp == Some(0) {
        return Err(argument("spp", "expected at least 1"));
    }
    let duration = |seconds: f64| {
        let time = Duration::try_from_secs_f64(seconds).ok();
        time.ok_or_else(|| argument("time", "expected a number of seconds, not below 0"))
    };
    let time = time.map(duration).transpose()?;
    let default = time.is_none().then_some(DEFAULT_SPP);
    Ok(Budget {
        samples: spp.or(default),
        time,
        ..Budget::default()
    })
}

/// The table of an argument: a table, a file or a name.
fn held<'py>(table: &Bound<'py, PyAny>) -> PyResult<Bound<'py, Table>> {
    if let Ok(table) = table.cast::<Table>() {
        return Ok(table.clone());
    }
    let path: PathBuf = table.extract().map_err(|_| {
        let what = "table: expected a Table, a file, beta-0.001 or beta-0.05";
        PyTypeError::new_err(what)
    })?;
    Bound::new(table.py(), Table::load(path)?)
}

/// Estimator and rule, and the hash of the table.
fn method(
    table: Option<&Bound<'_, Table>>,
    gamma: Option<f32>,
    rule: Option<&str>,
    reuse: bool,
    integrator: &str,
) -> PyResult<(Settings, Option<String>)> {
    let factors = gamma.is_some() || table.is_some();
    if gamma.is_some() && table.is_some() {
        return Err(argument("gamma", "a table has factors of its own"));
    }
    if rule.is_some() && (factors || reuse) {
        let what = "a rule of its own: no table, gamma or reuse";
        return Err(argument("rule", what));
    }
    if reuse && !factors {
        return Err(argument("reuse", "needs a table or gamma"));
    }
    let kind = match rule {
        None => Kind::Plain,
        Some("pbrt") => Kind::Pbrt,
        Some("filter-glossy") => Kind::FilterGlossy,
        Some("roughness-clamp") => Kind::RoughnessClamp,
        Some("mollifier") => Kind::Mollifier,
        Some(_) => {
            let what = "expected pbrt, filter-glossy, roughness-clamp or mollifier";
            return Err(argument("rule", what));
        }
    };
    let integrator = serde_json::from_value(json!(integrator));
    let fault = |e: serde_json::Error| argument("integrator", e);
    let spec = json!({ "name": "", "method": kind });
    let mut spec: MethodSpec = serde_json::from_value(spec).map_err(fault)?;
    spec.integrator = integrator.map_err(fault)?;
    spec.gamma = gamma.map(|gamma| unit("gamma", gamma)).transpose()?;
    spec.reuse = reuse;
    // Named only for the check, and then put in its place.
    spec.table = table.map(|_| PathBuf::new());
    spec.refused()
        .map_err(pyo3::exceptions::PyValueError::new_err)?;
    spec.table = None;
    let method = spec.resolve().map_err(crate::errors::file)?;
    let table = table.map(|table| &table.get().file);
    let rule = table.map_or(method.rule, |file| Rule::with_table(file.table.clone()));
    let settings = Settings {
        estimator: method.estimator,
        rule,
        ..Settings::default()
    };
    let digest = table.map(|file| opsr::files::hex(&file.digest()));
    Ok((settings, digest))
}

/// Scales of levels by their number, or as they are given; empty for one level.
fn scales(levels: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    if !levels.is_instance_of::<PyInt>() {
        return levels.extract();
    }
    let roughest = SCALES[SCALES.len() - 1];
    match levels.extract::<usize>() {
        Ok(1) => Ok(Vec::new()),
        Ok(n) if n == SCALES.len() => Ok(SCALES.to_vec()),
        // Plain path tracing, and down from the roughest by factors of 5, as the program has them.
        Ok(n @ 2..=MAX_LEVELS) => {
            let scale = |k: usize| roughest * 0.2f32.powi((n - 1 - k) as i32);
            Ok(std::iter::once(0.0).chain((1..n).map(scale)).collect())
        }
        _ => {
            let what = format!("expected 1 to {MAX_LEVELS} levels");
            Err(argument("levels", what))
        }
    }
}

/// A picture without samples.
fn empty(
    frame: UVec2,
    window: Window,
    cropped: bool,
    settings: &Settings,
    aov: bool,
) -> PyResult<Picture> {
    let name = if cropped { "crop" } else { "size" };
    Moments::check(frame, window).map_err(|e| argument(name, e))?;
    // A failed allocation would end the interpreter.
    let levels = settings.levels.len();
    let each = PIXEL_BYTES + if aov { AOV_BYTES } else { 0 } + levels as u64 * LEVEL_BYTES;
    let what = format!("{}x{} pixels", window.w, window.h);
    memory::check(what, window.len() as u64 * each)
        .map_err(|e| PyMemoryError::new_err(e.to_string()))?;
    let film = Moments::cropped(frame, window).map_err(|e| argument(name, e))?;
    let mut picture = Picture::new(film);
    picture.aovs = aov.then(|| FirstHit::new(window).into());
    picture.levels = (levels > 0).then(|| LevelFilm::new(frame, window, levels));
    Ok(picture)
}

/// The metadata that the program writes into reproducible files.
fn metadata(scene: &Scene, settings: &Settings, table: Option<String>, spp: u32) -> Metadata {
    let mut metadata = Metadata::new();
    let mut set = |key: &str, value: String| {
        metadata.insert(key.to_owned(), value);
    };
    set("version", env!("CARGO_PKG_VERSION").to_owned());
    set("seed", settings.seed.to_string());
    set("scene", scene.path.display().to_string());
    set("scene_sha256", scene.sha256.clone());
    set("spp", spp.to_string());
    if let Some(hash) = table {
        set("table_sha256", hash);
    }
    if let Some(TableTuning { scale, contrast }) = settings.rule.table().map(|t| t.tuning()) {
        set("table_scale", scale.to_string());
        set("table_contrast", contrast.to_string());
    }
    if !settings.levels.is_empty() {
        set("levels", format!("{:?}", settings.levels));
    }
    metadata
}
