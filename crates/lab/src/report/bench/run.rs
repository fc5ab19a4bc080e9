//! The measurement of a suite.
//!
//! Each (scene, method, seed) is one progressive run: passes are timed, and the clocks stop while errors are computed.
//! Within a scene the methods alternate for each seed, each seed with another first one, so that a machine that gets
//! warm or busy affects all of them. The results are written after each run.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sha2::{Digest, Sha256};

use super::BenchError;
use super::errors::{error_map, error_products, errors};
use super::machine::{self, Machine};
use super::prepare::{Prepared, file_name, inset, prepare, short_hash};
use super::results::{Inset, Point, Products, Results, Run, VERSION};
use super::schedule::Schedule;
use super::suite::{MethodSpec, SceneSpec, Suite};
use opsr::files::{self, Problem, hex};
use opsr::image::denoise::Denoiser;
use opsr::image::film::Film;
use opsr::image::{Buffer, exr};
use opsr::integrator::Picture;
use opsr::math::UVec2;
use opsr::pilot::stopwatch::Stopwatch;
use opsr::render::value::{Crop, Size};
use opsr::render::{Fault, Heading, Request, Shown, Spec, Subject};
use opsr_metric::MetricError;

/// Samples per pixel for counting regularised vertices.
const CENSUS: u32 = 2;

/// Progress of a bench.
#[derive(Clone, Debug)]
pub struct Status {
    /// Current work.
    pub what: String,
    /// Number of finished runs, earlier ones included.
    pub done: usize,
    /// Number of all runs of the suite.
    pub total: usize,
}

/// End of a bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything is measured.
    Done,
    /// The callback stopped the bench; the file has the measurements so far.
    Stopped,
}

/// Callback after every pass, outside of the measured time. It can stop the bench.
pub type RenderCallback<'a> = &'a mut dyn FnMut(&Status) -> ControlFlow<()>;

/// Measures the runs of `suite` that are not yet in the file at `path`.
///
/// Pictures and references are stored in a folder beside the file.
pub fn run(
    suite: &Suite,
    path: &Path,
    command: &str,
    listener: RenderCallback<'_>,
) -> Result<(Results, Outcome), BenchError> {
    let machine = Machine::this();
    let mut results = Results {
        version: VERSION,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        command: command.to_owned(),
        machine,
        suite: suite.clone(),
        scenes: Vec::new(),
        cells: Vec::new(),
        products: Vec::new(),
        insets: Vec::new(),
    };
    if path.is_dir() {
        let cause = std::io::Error::other("is a folder");
        return Err(Problem::Write(cause).at(path).into());
    }
    if path.exists() {
        let old = Results::load(path)?;
        results.cells = old.cells;
        results.products = old.products;
        results.insets = old.insets;
    }
    let mut bench = Bench {
        suite,
        path,
        folder: path.with_extension("pictures"),
        results,
        denoiser: None,
        done: 0,
        listener,
    };
    let outcome = bench.scenes()?;
    bench.results.save(path)?;
    Ok((bench.results, outcome))
}

struct Bench<'a> {
    suite: &'a Suite,
    path: &'a Path,
    folder: PathBuf,
    results: Results,
    /// The denoiser, if a method needs it.
    denoiser: Option<Denoiser>,
    done: usize,
    listener: RenderCallback<'a>,
}

/// A run and its picture.
struct Measured {
    run: Run,
    picture: Buffer,
}

impl Measured {
    fn new(mut run: Run, film: &Film, picture: Buffer) -> Self {
        run.rejected = film.rejected.total();
        run.paths = film.pixels.iter().map(|p| u64::from(p.n)).sum::<u64>() + run.rejected;
        run.memory = machine::memory();
        Self { run, picture }
    }
}

impl Bench<'_> {
    fn scenes(&mut self) -> Result<Outcome, BenchError> {
        // Tables are read once, first: an unreadable one must not become known only after hours of measurement.
        let mut methods = self.suite.methods.clone();
        for choice in methods
            .iter_mut()
            .filter_map(|method| method.spec.table.as_mut())
        {
            choice.load()?;
        }
        // The same holds for a missing library and for a folder that cannot be written.
        if let Some(spec) = methods.iter().find(|m| m.spec.denoise == Some(true)) {
            let denoiser = Denoiser::open().map_err(|e| BenchError::Scene {
                place: format!("method `{}`", spec.name),
                reason: e.to_string(),
            })?;
            self.denoiser = Some(denoiser);
        }
        files::create_folder(&self.folder)?;
        for scene in &self.suite.scenes {
            let mut waiting = status(self.suite, self.done, format!("{}: reference", scene.name));
            let listener = &mut *self.listener;
            let what = waiting.what.clone();
            let prepared = prepare(scene, &self.folder, &mut |fraction| {
                waiting.what = format!("{what} {:.0} %", 100.0 * fraction);
                listener(&waiting)
            })?;
            let Some(prepared) = prepared else {
                return Ok(Outcome::Stopped);
            };
            self.results.scenes.push(prepared.facts.clone());
            let methods: Vec<&MethodSpec> = methods
                .iter()
                .filter(|e| self.suite.methods_of(scene).any(|m| m.name == e.name))
                .collect();
            if self.scene(scene, &prepared, &methods)? == Outcome::Stopped {
                return Ok(Outcome::Stopped);
            }
        }
        Ok(Outcome::Done)
    }

    fn scene(
        &mut self,
        spec: &SceneSpec,
        scene: &Prepared,
        methods: &[&MethodSpec],
    ) -> Result<Outcome, BenchError> {
        let base = self.base_key(spec, scene);
        self.show(inset(spec, None, &base, &scene.reference));
        for (round, seed) in self.suite.seeds().enumerate() {
            for turn in 0..methods.len() {
                let method = methods[(turn + round) % methods.len()];
                let render = method.render(spec.max_vertices, seed);
                let render = render_of(spec, render, self.suite);
                let subject = Subject {
                    scene: &scene.scene,
                    name: "",
                    sha256: "",
                    in_studio: false,
                };
                let request = Request::new(&render, subject, Some(scene.camera.clone()));
                // The key has the method's name, because a method may be measured against itself.
                let key = |words: &str| short_hash(&serde_json::json!([base, method.name, words]));
                match request {
                    Ok(request) => {
                        let key = key(&words(&request));
                        if !self.results.cells.iter().any(|c| c.key == key) {
                            let measured =
                                self.measure(spec, scene, &method.name, request, &key)?;
                            let Some(measured) = measured else {
                                return Ok(Outcome::Stopped);
                            };
                            self.keep(spec, measured, round == 0)?;
                        }
                    }
                    Err(Fault::Option {
                        name: "integrator",
                        why,
                    }) => {
                        let key = key(&render.words(&[Heading::Method]));
                        self.refuse(spec, &method.name, seed, &key, &why)?;
                    }
                    Err(fault) => {
                        return Err(BenchError::Scene {
                            place: format!("`{}`, method `{}`", spec.name, method.name),
                            reason: fault.to_string(),
                        });
                    }
                }
                self.done += 1;
            }
        }
        for method in methods {
            self.multiply(spec, scene, &method.name)?;
        }
        self.results.save(self.path)?;
        Ok(Outcome::Done)
    }

    /// Hash of the inputs that all runs of a scene have in common.
    fn base_key(&self, spec: &SceneSpec, scene: &Prepared) -> String {
        let mut pixels = Sha256::new();
        for p in &scene.reference.pixels {
            pixels.update(bytemuck::bytes_of(p));
        }
        let mut spec = spec.clone();
        spec.methods = None;
        spec.group = None;
        let Results {
            program, machine, ..
        } = &self.results;
        let Suite {
            times,
            samples,
            clock,
            ..
        } = self.suite;
        let reference = hex(&pixels.finalize());
        let source = &scene.facts.source;
        short_hash(&serde_json::json!([
            program, machine, times, samples, clock, spec, source, reference
        ]))
    }

    fn measure(
        &mut self,
        spec: &SceneSpec,
        scene: &Prepared,
        name: &str,
        mut request: Request<'_>,
        key: &str,
    ) -> Result<Option<Measured>, BenchError> {
        let seed = request.settings.seed;
        let status = status(
            self.suite,
            self.done,
            format!("{}: {name}, seed {seed}", spec.name),
        );
        let fault = |reason: String| BenchError::Scene {
            place: format!("`{}`, method `{name}`", spec.name),
            reason,
        };
        let mut now = Point::default();
        let watch = Stopwatch::start();
        // A pilot plans for the longest time of the suite.
        if let Some(longest) = self.suite.times.last() {
            request.spec.time = Duration::try_from_secs_f64(*longest).ok();
        }
        let begun = request.begin(&|| true).map_err(|e| fault(e.to_string()))?;
        let Some(begun) = begun else {
            return Ok(None);
        };
        if let Some(choice) = &begun.choice {
            tracing::info!("{}: {name}: {choice}", spec.name);
            (now.wall, now.cpu) = watch.seconds();
        }
        let pilot = now.cpu;
        let (view, method) = (request.view(), &request.spec);
        let settings = &request.settings;
        let mut integrator = settings.integrator();
        let mut picture = begun.picture;
        let mut shown = Buffer::default();
        let mut schedule = Schedule::new(self.suite, self.results.machine.threads);
        let mut points = Vec::new();
        while let Some(end) = schedule.next(&now) {
            if (self.listener)(&status).is_break() {
                return Ok(None);
            }
            let watch = Stopwatch::start();
            integrator.pass(&view, now.samples..end, &mut picture);
            let (wall, cpu) = watch.seconds();
            now.wall += wall;
            now.cpu += cpu;
            now.samples = end;
            if schedule.crossed(&now) {
                let denoiser = self.denoiser.as_ref();
                let denoiser = denoiser.filter(|_| method.denoise == Some(true));
                let looked = Look {
                    scene: spec,
                    reference: &scene.reference,
                };
                let (point, last) = looked.at(&now, &picture, method, denoiser).map_err(fault)?;
                points.push(point);
                shown = last;
            }
        }
        let run = Run {
            regularised: settings.regularised_share(&view, 0..CENSUS, &scene.blank),
            scene: spec.name.clone(),
            method: name.to_owned(),
            seed,
            key: key.to_owned(),
            points,
            pilot,
            ..Run::default()
        };
        Ok(Some(Measured::new(run, &picture.film, shown)))
    }

    /// Stores that the scene refuses the method.
    fn refuse(
        &mut self,
        spec: &SceneSpec,
        method: &str,
        seed: u64,
        key: &str,
        why: &str,
    ) -> Result<(), BenchError> {
        tracing::warn!("{}: {method} is left out: {why}", spec.name);
        let run = Run {
            scene: spec.name.clone(),
            method: method.to_owned(),
            seed,
            key: key.to_owned(),
            refused: Some(why.to_owned()),
            ..Run::default()
        };
        self.take(run)
    }

    /// Stores a run with its picture, and writes the results.
    fn keep(&mut self, spec: &SceneSpec, measured: Measured, show: bool) -> Result<(), BenchError> {
        let Measured { run, picture } = measured;
        files::create_folder(&self.folder)?;
        exr::write_rgb(&self.picture(&run.key), &picture, &exr::Metadata::new())?;
        if show && let Some(end) = run.points.last() {
            let seconds = self.suite.clock.seconds(end, self.results.machine.threads);
            let inset = inset(spec, Some(&run.method), &run.key, &picture);
            let samples = end.samples;
            self.show(Inset {
                samples,
                seconds,
                ..inset
            });
        }
        self.take(run)
    }

    /// Replaces an older run of the same scene, method and seed, and writes the results.
    fn take(&mut self, run: Run) -> Result<(), BenchError> {
        self.results
            .cells
            .retain(|c| (&c.scene, &c.method, c.seed) != (&run.scene, &run.method, run.seed));
        self.results.cells.push(run);
        Ok(self.results.save(self.path)?)
    }

    fn picture(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.exr"))
    }

    fn show(&mut self, inset: Inset) {
        let insets = &mut self.results.insets;
        insets.retain(|i| (&i.scene, &i.method) != (&inset.scene, &inset.method));
        insets.push(inset);
    }

    /// Stores products of errors between all seeds of a method; none if a picture is missing.
    fn multiply(
        &mut self,
        spec: &SceneSpec,
        scene: &Prepared,
        method: &str,
    ) -> Result<(), BenchError> {
        let runs = self.results.runs(&spec.name, method);
        let keys: Vec<String> = runs.iter().map(|c| c.key.clone()).collect();
        if keys.is_empty() {
            return Ok(());
        }
        if self
            .results
            .products(&spec.name, method)
            .is_some_and(|p| p.keys == keys)
        {
            return Ok(());
        }
        let products = &mut self.results.products;
        products.retain(|p| (&p.scene, p.method.as_str()) != (&spec.name, method));
        let files: Vec<PathBuf> = keys.iter().map(|k| self.picture(k)).collect();
        if files.iter().any(|f| !f.exists()) {
            tracing::warn!(
                "{}: {method}: pictures are gone, no bias",
                file_name(&self.folder)
            );
            return Ok(());
        }
        let pictures = files
            .iter()
            .map(|f| exr::read_rgb(f))
            .collect::<Result<Vec<_>, _>>()?;
        let values = error_products(&pictures, &scene.reference);
        self.results.products.push(Products {
            scene: spec.name.clone(),
            method: method.to_owned(),
            keys,
            values,
        });
        Ok(())
    }
}

/// A scene and its reference, with which pictures are compared.
struct Look<'a> {
    scene: &'a SceneSpec,
    reference: &'a Buffer,
}

impl Look<'_> {
    /// The picture at a time point and its errors. The time for resolve and denoising counts at this point, but not in
    /// the passes that follow.
    fn at(
        &self,
        now: &Point,
        picture: &Picture,
        method: &Spec,
        denoiser: Option<&Denoiser>,
    ) -> Result<(Point, Buffer), String> {
        let watch = Stopwatch::start();
        let shown = Shown::of(picture, method, denoiser).map_err(|e| e.to_string())?;
        let Shown {
            picture: shown,
            resolved,
            ..
        } = shown;
        let (wall, cpu) = watch.seconds();
        let mut errors = errors(&shown, self.reference, self.scene.exposure)
            .map_err(|e: MetricError| e.to_string())?;
        if let Some(resolved) = resolved.filter(|r| r.picture == shown) {
            // The estimate from one sample is infinite.
            let map = error_map(&resolved, self.reference).map_err(|e| e.to_string())?;
            errors.extend(map.into_iter().filter(|(_, value)| value.is_finite()));
        }
        let mut point = now.clone();
        if picture.levels.is_some() || denoiser.is_some() {
            point.wall += wall;
            point.cpu += cpu;
        }
        Ok((point.with(errors), shown))
    }
}

/// The render of a scene's view. Its time or samples are the last of the suite: a pilot plans for them.
fn render_of(scene: &SceneSpec, mut spec: Spec, suite: &Suite) -> Spec {
    let [w, h] = scene.size;
    spec.size = Some(Size::Pixels(UVec2::new(w, h)));
    spec.crop = scene.crop.map(|[x, y, w, h]| Crop::pixels(x, y, w, h));
    match (suite.times.last(), suite.samples.last()) {
        (Some(&seconds), _) => spec.time = Some(Duration::from_secs_f64(seconds)),
        (None, samples) => spec.spp = samples.copied(),
    }
    spec
}

/// The settings of a run as text, for its key.
fn words(request: &Request<'_>) -> String {
    let mut words = request.settings.fingerprint();
    for (option, text) in request.spec.given().filter(|(option, _)| option.of_film) {
        words += &format!(", {} {text}", option.name);
    }
    if request.spec.kind() != request.kind {
        words += ", auto";
    }
    words
}

fn status(suite: &Suite, done: usize, what: String) -> Status {
    let runs: usize = suite
        .scenes
        .iter()
        .map(|s| suite.methods_of(s).count())
        .sum();
    Status {
        what,
        done,
        total: runs * suite.seeds as usize,
    }
}
