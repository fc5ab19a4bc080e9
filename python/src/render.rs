//! Renders, whole or in parts.

use crate::errors::{argument, file};
use crate::film::Film;
use crate::scene::Scene;
use crate::table::{Table, positive, unit};
use crate::work::{Hear, Link, watched};
use opsr::files::FileError;
use opsr::image::exr::Metadata;
use opsr::image::film::{Film as Moments, FilmError, Window};
use opsr::image::level_film::MAX_LEVELS;
use opsr::integrator::checkpoint::Fingerprint;
use opsr::integrator::drive::{Budget, ErrorBound, RenderProgress, drive};
use opsr::integrator::layers::{Aov, Layers};
use opsr::integrator::levels;
use opsr::integrator::method::{IntegratorKind, Kind, MethodSpec};
use opsr::integrator::part::{self, MergeError, Merged, Part};
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::UVec2;
use opsr::memory;
use opsr::pilot::{Contender, Horizon, SPP_OF_TARGET, choose_integrator, left_after};
use opsr::regularise::{Factors, Rule};
use opsr::resolve::{Resolve, resolve_film, stopping_error};
use opsr::scene::{Camera, Lens};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyInt, PyString};
use serde_json::json;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Samples per pixel of a render without a budget.
const DEFAULT_SPP: u32 = 128;

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
/// spp, time, target_error: when to stop, in samples per pixel, in seconds, or at an estimated relative error of the picture
///     (the root of its relMSE), the first one reached; 128 samples by default.
/// seed: seed of all random numbers, from 0 to 2**64 - 1.
/// table: learned attenuation factors: a Table, a file, or "beta-0.001" or "beta-0.05".
/// table_scale: factor on the table's factors, above 0, instead of its own.
/// gamma: one attenuation factor from 0 to 1 for all paths, instead of a table.
/// rule: a rule of other renderers instead of both, for comparison: "pbrt", "filter-glossy", "roughness-clamp" or
///     "mollifier".
/// filter: value of "filter-glossy", above 0; 1 by default.
/// reuse: continue paths with the roughened lobe; needs a table or gamma.
/// consistent: exponent between 0 and 0.5 with which the bias vanishes: sample n roughens by n**-consistent of the full
///     amount; needs a table or gamma.
/// integrator: "path", "light", "bdpt", "vcm", "sppm" or "mlt"; "light" and "sppm" take no table or gamma, and only "bdpt" and
///     "mlt" a rule, the mollifier. "auto" takes the one of path, bdpt, vcm and sppm with the least expected error, by a pilot
///     of a few per cent of the render; `Film.metadata` says which.
/// radius, radius_alpha: first radius within which the photons of "vcm" and "sppm" count, in scene units, above 0, by default
///     twice a pixel's footprint; and its shrinking, above 0 and at most 1, by default 2/3.
/// connections: "all" or "nee" (light samples only) of "vcm".
/// mlt_pass: mutations per pixel of one sample of "mlt", from 1 to 65536; 16 by default.
/// aperture, focus: radius of the camera's lens, 0 for none, and distance that is in focus, in scene units; by default those
///     of the file.
/// levels: several amounts of roughening on the same paths, of which every pixel gets the best: their number from 1 to 8, or
///     the scales of the table's, the constant factor or the filter's value, ascending from 0; 1 takes the table or the
///     constant as it is. By default four where there can be levels, as in the program: "path" with a table or a constant,
///     without reuse, consistent and the layers emission, direct and indirect.
/// max_vertices: scattering vertices of the longest path, from 1 to 65536.
/// sampler: random numbers of camera paths of "path": "sobol", or "independent", whose variances are unbiased.
/// threads: their number; all cores by default.
/// aov: layers to record: names of those of the program's --aov, or True for albedo, normal and depth.
/// on_progress: called with a Progress after each pass; False ends the render, which then has the samples so far.
/// part: write this file instead, for `merge`, and return None. It is whole or not there.
/// samples: (first, last + 1) of the samples of a part; by default all `spp`.
///
/// Ctrl-C ends the render after the current pass and raises KeyboardInterrupt. Raises ValueError for settings that cannot
/// be, MemoryError for pictures that are too large for this machine.
#[pyfunction]
#[pyo3(signature = (
    scene, *, camera=None, size=None, crop=None, spp=None, time=None, target_error=None, seed=0, table=None,
    table_scale=None, gamma=None, rule=None, filter=None, reuse=false, consistent=None,
    integrator="path", radius=None, radius_alpha=None, connections=None, mlt_pass=None, aperture=None, focus=None,
    levels=None, max_vertices=16, sampler="sobol", threads=None, aov=None, on_progress=None, part=None, samples=None
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
    target_error: Option<f64>,
    seed: u64,
    table: Option<&Bound<'_, PyAny>>,
    table_scale: Option<f32>,
    gamma: Option<f32>,
    rule: Option<&str>,
    filter: Option<f32>,
    reuse: bool,
    consistent: Option<f32>,
    integrator: &str,
    radius: Option<f32>,
    radius_alpha: Option<f32>,
    connections: Option<&str>,
    mlt_pass: Option<u32>,
    aperture: Option<f32>,
    focus: Option<f32>,
    levels: Option<&Bound<'_, PyAny>>,
    max_vertices: u32,
    sampler: &str,
    threads: Option<u16>,
    aov: Option<&Bound<'_, PyAny>>,
    on_progress: Option<Py<PyAny>>,
    part: Option<PathBuf>,
    samples: Option<(u32, u32)>,
) -> PyResult<Option<Film>> {
    let scene = scene.get();
    let frame = frame(scene, camera, size)?;
    let mut camera = scene.camera(camera, frame.x as f32 / frame.y as f32)?;
    camera.lens = lens(camera.lens, aperture, focus)?;
    let budget = budget(spp, time, target_error)?;
    if !(1..=65536).contains(&max_vertices) {
        return Err(argument("max_vertices", "expected 1 to 65536"));
    }
    let table = table.map(held).transpose()?;
    let scale = table_scale
        .map(|x| positive("table_scale", x))
        .transpose()?;
    if scale.is_some() && table.is_none() {
        return Err(argument("table_scale", "needs a table"));
    }
    let mut spec = spec(
        table.is_some(),
        gamma,
        rule,
        filter,
        reuse,
        consistent,
        integrator,
    )?;
    spec.sampler = serde_json::from_value(json!(sampler))
        .map_err(|e: serde_json::Error| argument("sampler", e))?;
    let known = |text| serde_json::from_value(json!(text)).map_err(|e| argument("connections", e));
    spec.connections = connections.map(known).transpose()?;
    spec.radius = radius.map(|r| positive("radius", r)).transpose()?;
    spec.radius_alpha = radius_alpha
        .map(|a| positive("radius_alpha", a).and_then(|a| unit("radius_alpha", a)))
        .transpose()?;
    if mlt_pass.is_some_and(|n| !(1..=65536).contains(&n)) {
        return Err(argument("mlt_pass", "expected 1 to 65536"));
    }
    spec.mlt_pass = mlt_pass;
    spec.refused().map_err(PyValueError::new_err)?;
    let scales = levels.map(scales).transpose()?;
    let aovs = aov.map(layers).transpose()?.unwrap_or_default();
    let [_, splits_light, _] = Aov::recorded(&aovs);
    let auto = spec.integrator == IntegratorKind::Auto;
    let settings = |spec: MethodSpec| -> PyResult<Settings> {
        let kind = spec.integrator;
        let mut settings = settings(spec, table.as_ref(), scale)?;
        (settings.max_vertices, settings.seed) = (max_vertices, seed);
        settings.levels = match &scales {
            // Candidates without levels stay in the race.
            Some(_) if auto && settings.rule == Rule::Plain && kind != IntegratorKind::Auto => {
                Vec::new()
            }
            Some(scales) => scales.clone(),
            None if splits_light => Vec::new(),
            None => (settings.usual_levels(scene.world.has_lobes())).unwrap_or_default(),
        };
        Ok(settings)
    };
    let mut contenders = Vec::new();
    if auto {
        for spec in spec.contenders() {
            let own_table = spec.table.is_some() && table.is_none();
            let (kind, settings) = (spec.integrator, settings(spec)?);
            // A table that nobody asked for is for levels alone.
            if own_table && settings.levels.is_empty() {
                continue;
            }
            if kind.is_path() || check_layers(&aovs, &settings).is_ok() {
                contenders.push(Contender { kind, settings });
            }
        }
    }
    let settings = settings(spec.clone())?;
    let fault = |e| argument("levels", e);
    settings.check_levels().map_err(fault)?;
    let fault = |e| argument("integrator", e);
    settings.check_scene(&scene.world, &camera).map_err(fault)?;
    check_layers(&aovs, &settings)?;
    let window = crop.map_or(Window::full(frame), |(x, y, w, h)| Window { x, y, w, h });
    let name = if crop.is_some() { "crop" } else { "size" };
    let digest = table.map(|table| opsr::files::hex(&table.get().file.digest()));
    let job = Job {
        scene,
        camera,
        frame,
        window,
        name,
        aovs,
        spec,
        contenders,
        digest,
    };
    let mut hear = on_progress.map(|call| {
        move |py: Python<'_>, progress: RenderProgress| {
            let answer = call.call1(py, (Progress::from(progress),))?;
            Ok(!answer.bind(py).is(PyBool::new(py, false)))
        }
    });
    let hear: Hear<'_, RenderProgress> = hear.as_mut().map(|hear| hear as _);
    job.check_memory(&settings)?;
    if let Some(path) = part {
        let samples = samples.unwrap_or((0, spp.unwrap_or(DEFAULT_SPP)));
        job.check_part(samples, time.is_some() || target_error.is_some())?;
        let done = watched(py, threads, hear, |link| {
            job.part(&settings, path, samples, link)
        })?;
        return match done.map_err(file)? {
            true => Ok(None),
            false => Err(argument("part", "not written, since on_progress ended it")),
        };
    }
    if samples.is_some() {
        return Err(argument("samples", "needs a part to write"));
    }
    let made = watched(py, threads, hear, |link| job.film(settings, budget, link))?;
    Ok(Some(made.map_err(|e| argument(name, e))?))
}

/// A render whose arguments are checked.
struct Job<'a> {
    scene: &'a Scene,
    camera: Camera,
    frame: UVec2,
    window: Window,
    /// Argument that chose the window.
    name: &'static str,
    aovs: Vec<Aov>,
    spec: MethodSpec,
    /// Integrators among which a pilot chooses.
    contenders: Vec<Contender>,
    /// SHA-256 of the table.
    digest: Option<String>,
}

impl Job<'_> {
    /// Refuses what would fail to be allocated, which would end the interpreter.
    fn check_memory(&self, settings: &Settings) -> PyResult<()> {
        let window = self.window;
        Moments::check(self.frame, window).map_err(|e| argument(self.name, e))?;
        let bytes = settings.bytes(self.frame, window, Aov::recorded(&self.aovs));
        memory::check(format!("{}x{} pixels", window.w, window.h), bytes)
            .map_err(|e| PyMemoryError::new_err(e.to_string()))
    }

    fn view(&self) -> View<'_> {
        View::new(&self.scene.world, &self.camera, self.frame, self.window)
    }

    /// Text for the file of the picture, as the program writes it into reproducible files.
    fn metadata(&self, settings: &Settings, kind: IntegratorKind) -> Metadata {
        let path = self.scene.path.display().to_string();
        let mut metadata = settings.metadata(&path, &self.scene.sha256, self.digest.as_deref());
        let words = self.spec.words(kind);
        metadata.extend(words.map(|(key, value)| (key.to_owned(), value)));
        metadata
    }

    fn film(
        &self,
        mut settings: Settings,
        mut budget: Budget,
        link: &Link<RenderProgress>,
    ) -> Result<Film, FilmError> {
        let view = self.view();
        let mut kind = self.spec.integrator;
        if kind == IntegratorKind::Auto {
            let clock = Instant::now();
            let horizon = match (budget.samples, budget.time) {
                (Some(samples), _) => Horizon::Samples(samples),
                (None, Some(time)) => {
                    Horizon::Seconds(time.as_secs_f64() * rayon::current_num_threads() as f64)
                }
                (None, None) => Horizon::Samples(SPP_OF_TARGET),
            };
            let go_on = || !link.stopped();
            // Counted paths for time, so that the picture depends on the arguments alone.
            let counted = budget.time.is_none();
            let choice = choose_integrator(&self.contenders, &view, horizon, counted, &go_on)?;
            let best = &self.contenders[choice.map_or(0, |choice| choice.best)];
            (kind, settings) = (best.kind, best.settings.clone());
            budget.time = budget.time.map(|time| left_after(time, clock.elapsed()));
        }
        let (levels, recorded) = (settings.levels.len(), Aov::recorded(&self.aovs));
        let mut picture = Picture::blank(self.frame, self.window, levels, recorded)?;
        let listen = &mut |progress: &RenderProgress, _: &Picture| link.tell(|| *progress);
        let mut integrator = settings.integrator();
        let (progress, _) = drive(&mut *integrator, &view, &budget, 0, &mut picture, listen);
        let mut metadata = self.metadata(&settings, kind);
        stamp(&mut metadata, progress.samples, &picture);
        Ok(Film {
            choice: (picture.levels.as_ref()).map(|film| resolve_film(film, Resolve::default())),
            layers: Layers::new(&self.aovs, &view).of(&picture),
            camera: self.camera.world_to_camera(),
            made: picture,
            metadata,
            spp: progress.samples,
            seconds: progress.elapsed.as_secs_f64(),
        })
    }

    /// An error for what a part cannot be.
    fn check_part(&self, samples: (u32, u32), bounded: bool) -> PyResult<()> {
        let wants = |aov| self.aovs.contains(&aov);
        if samples.0 >= samples.1 {
            return Err(argument("samples", "expected (first, last + 1)"));
        }
        if wants(Aov::Position) || wants(Aov::Id) || wants(Aov::Time) {
            return Err(argument("aov", "a part keeps no position, id and time"));
        }
        if self.spec.integrator == IntegratorKind::Auto {
            let what = "auto chooses by a pilot, for each part anew: name one";
            return Err(argument("integrator", what));
        }
        if bounded {
            let what = "has a number of samples: no time or target_error";
            return Err(argument("part", what));
        }
        Ok(())
    }

    fn part(
        &self,
        settings: &Settings,
        path: PathBuf,
        (start, end): (u32, u32),
        link: &Link<RenderProgress>,
    ) -> Result<bool, FileError> {
        let view = self.view();
        let [first, light, _] = Aov::recorded(&self.aovs);
        // Parts of one render are made by one program, or by this package.
        let words = format!(
            "Python: {}, {}x{}, camera {:?}, {:?}, {:?}, scene {}",
            settings.fingerprint(),
            self.frame.x,
            self.frame.y,
            self.camera.name,
            self.camera.lens,
            self.aovs,
            self.scene.words,
        );
        let fingerprint = Fingerprint {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: self.scene.sha256.clone(),
            settings: words,
        };
        let levels = settings.levels.clone();
        let mut part = Part::new(fingerprint, &view, start..end, levels, [first, light]);
        part.layers = self.aovs.iter().map(|aov| aov.name()).collect();
        part.metadata = self.metadata(settings, self.spec.integrator);
        let listen = &mut |progress: &RenderProgress| link.tell(|| *progress);
        part.render(&path, &mut *settings.integrator(), &view, listen)
    }
}

/// Adds what only the end of a render knows.
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
///
/// Raises ValueError for parts of different renders, for samples that are missing or there twice, each by name, and for
/// damaged files; OSError for those that cannot be read.
#[pyfunction]
#[pyo3(signature = (parts, *, spp=None, crop=None))]
pub(crate) fn merge(
    py: Python<'_>,
    parts: Vec<PathBuf>,
    spp: Option<u32>,
    crop: Option<(u32, u32, u32, u32)>,
) -> PyResult<Film> {
    let window = |size| crop.map_or(Window::full(size), |(x, y, w, h)| Window { x, y, w, h });
    let merged = watched::<(), _>(py, None, None, |_| part::merge(&parts, window, spp))?;
    let Merged {
        first,
        samples,
        picture,
    } = merged.map_err(|error| match error {
        MergeError::File(error) => file(error),
        MergeError::Memory(shortage) => PyMemoryError::new_err(shortage.to_string()),
        MergeError::Samples(what) => argument("parts", what),
    })?;
    let wanted = first.layers.iter().map(|name| Aov::named(name));
    let wanted = wanted.collect::<Result<Vec<_>, _>>();
    let wanted = wanted.map_err(|e| argument("parts", e))?;
    let mut metadata = first.metadata;
    stamp(&mut metadata, samples, &picture);
    Ok(Film {
        choice: (picture.levels.as_ref()).map(|film| resolve_film(film, Resolve::default())),
        layers: Layers::recorded(&wanted).of(&picture),
        camera: first.camera,
        made: picture,
        metadata,
        spp: samples,
        seconds: 0.0,
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
        None => Ok(scene.camera(camera, 1.0)?.default_frame()),
    }
}

fn budget(spp: Option<u32>, time: Option<f64>, error: Option<f64>) -> PyResult<Budget> {
    if spp == Some(0) {
        return Err(argument("spp", "expected at least 1"));
    }
    if error.is_some_and(|e| e.is_nan() || e <= 0.0) {
        return Err(argument("target_error", "expected a number above 0"));
    }
    let duration = |seconds: f64| {
        let time = Duration::try_from_secs_f64(seconds).ok();
        time.ok_or_else(|| argument("time", "expected a number of seconds, not below 0"))
    };
    let time = time.map(duration).transpose()?;
    let default = (time.is_none() && error.is_none()).then_some(DEFAULT_SPP);
    Ok(Budget {
        samples: spp.or(default),
        time,
        error: error.map(|bound| ErrorBound {
            bound,
            estimate: stopping_error,
        }),
    })
}

/// The lens of a camera whose file says `file`.
fn lens(file: Option<Lens>, aperture: Option<f32>, focus: Option<f32>) -> PyResult<Option<Lens>> {
    if aperture.is_some_and(|r| !(r >= 0.0 && r.is_finite())) {
        return Err(argument("aperture", "expected a number, not below 0"));
    }
    let focus = focus.map(|x| positive("focus", x)).transpose()?;
    let radius = aperture.or(file.map(|lens| lens.radius));
    match (radius, focus.or(file.map(|lens| lens.focus))) {
        (Some(0.0), _) | (None, None) => Ok(None),
        (Some(radius), Some(focus)) => Ok(Some(Lens { radius, focus })),
        (Some(_), None) => Err(argument("aperture", "needs focus")),
        (None, Some(_)) => Err(argument("focus", "needs aperture")),
    }
}

/// Layers by name; True stands for albedo, normal and depth.
fn layers(aov: &Bound<'_, PyAny>) -> PyResult<Vec<Aov>> {
    if let Ok(some) = aov.cast::<PyBool>() {
        let usual = [Aov::Albedo, Aov::Normal, Aov::Depth];
        return Ok(if some.is_true() {
            usual.into()
        } else {
            Vec::new()
        });
    }
    let names: Vec<String> = match aov.cast::<PyString>() {
        Ok(name) => vec![name.extract()?],
        Err(_) => aov.extract()?,
    };
    let layer = |name: &String| Aov::named(name).map_err(|e| argument("aov", e));
    names.iter().map(layer).collect()
}

fn check_layers(aovs: &[Aov], settings: &Settings) -> PyResult<()> {
    let [_, light, _] = Aov::recorded(aovs);
    let path = matches!(settings.estimator, Estimator::Path { .. }) && settings.levels.is_empty();
    if light && !path {
        let what = "emission, direct and indirect are of the path tracer with one level";
        return Err(argument("aov", what));
    }
    if aovs.contains(&Aov::Level) && settings.levels.is_empty() {
        return Err(argument("aov", "level needs levels"));
    }
    Ok(())
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

/// The method of these arguments, without its table.
fn spec(
    table: bool,
    gamma: Option<f32>,
    rule: Option<&str>,
    filter: Option<f32>,
    reuse: bool,
    consistent: Option<f32>,
    integrator: &str,
) -> PyResult<MethodSpec> {
    let factors = gamma.is_some() || table;
    if gamma.is_some() && table {
        return Err(argument("gamma", "a table has factors of its own"));
    }
    if rule.is_some() && (factors || reuse || consistent.is_some()) {
        let what = "a rule of its own: no table, gamma, reuse or consistent";
        return Err(argument("rule", what));
    }
    if reuse && !factors {
        return Err(argument("reuse", "needs a table or gamma"));
    }
    if consistent.is_some() && !factors {
        return Err(argument("consistent", "needs a table or gamma"));
    }
    if consistent.is_some_and(|x| !(x > 0.0 && x < 0.5)) {
        let what = "expected a number between 0 and 0.5";
        return Err(argument("consistent", what));
    }
    if filter.is_some_and(|x| !(x > 0.0 && x.is_finite())) {
        return Err(argument("filter", "expected a number above 0"));
    }
    let kind = match rule {
        None if reuse => Kind::Reuse,
        None => Kind::Default,
        Some("pbrt") => Kind::Pbrt,
        Some("filter-glossy") => Kind::FilterGlossy,
        Some("roughness-clamp") => Kind::RoughnessClamp,
        Some("mollifier") => Kind::Mollifier,
        Some(_) => {
            let what = "expected pbrt, filter-glossy, roughness-clamp or mollifier";
            return Err(argument("rule", what));
        }
    };
    if filter.is_some() && kind != Kind::FilterGlossy {
        return Err(argument("filter", "needs rule=\"filter-glossy\""));
    }
    let integrator = serde_json::from_value(json!(integrator));
    let fault = |e: serde_json::Error| argument("integrator", e);
    let mut spec: MethodSpec =
        serde_json::from_value(json!({ "name": "", "method": "plain" })).map_err(fault)?;
    spec.integrator = integrator.map_err(fault)?;
    spec.method = kind;
    spec.gamma = gamma.map(|gamma| unit("gamma", gamma)).transpose()?;
    (spec.filter, spec.lambda) = (filter, consistent);
    // Named only for checks.
    spec.table = table.then(PathBuf::new);
    Ok(spec)
}

/// Estimator and rule of a method with this table.
fn settings(
    mut spec: MethodSpec,
    table: Option<&Bound<'_, Table>>,
    scale: Option<f32>,
) -> PyResult<Settings> {
    let table = table.filter(|_| spec.table.is_some());
    if table.is_some() {
        // Its place.
        spec.gamma = Some(0.0);
    }
    let method = spec.resolve().map_err(file)?;
    let mut settings = Settings {
        estimator: method.estimator,
        rule: method.rule,
        sampler: spec.sampler,
        ..Settings::default()
    };
    if let Some((Rule::Accumulated(rule), table)) = Some(&mut settings.rule).zip(table) {
        let mut table = table.get().file.table.clone();
        if let Some(scale) = scale {
            table.scale = scale;
        }
        rule.factors = Factors::Table(table);
    }
    Ok(settings)
}

/// Scales of levels by their number, or as they are given; empty for one level.
fn scales(wanted: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    if !wanted.is_instance_of::<PyInt>() {
        return wanted.extract();
    }
    let known = wanted.extract::<usize>().ok().and_then(levels::scales);
    known.ok_or_else(|| argument("levels", format!("expected 1 to {MAX_LEVELS} levels")))
}
