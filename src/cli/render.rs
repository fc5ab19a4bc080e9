//! `opsr render`: a glTF scene in, a picture out.

use super::aovs;
use super::bar::Style;
use super::job::Size;
use super::listener::{Closed, Listener, Run};
use super::output::{Outputs, Provenance, can_write, check_distinct};
use super::render_args::RenderArgs;
use super::scene::{self, Opened};
use super::stop::Stop;
use super::{Blame, Exit, auto, job, part, trace};
use anyhow::{Context, anyhow};
use opsr::files;
use opsr::image::film::{Film, Window};
use opsr::image::level_film::LevelFilm;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::drive::{Budget, ErrorBound, Reason, RenderProgress, drive};
use opsr::integrator::method::IntegratorKind;
use opsr::integrator::{self, Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2};
use opsr::memory;
use opsr::pilot::left_after;
use opsr::pilot::witness::{Missing, missing_light};
use opsr::resolve::{stopping_error, unseen_share};
use opsr::scene::Camera;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Samples of a render whose budget is not given.
pub(super) const DEFAULT_SPP: u32 = 128;

/// Runs the command.
pub(super) fn run(args: &RenderArgs) -> anyhow::Result<Exit> {
    let begun = Instant::now();
    // A part makes no picture.
    let pictures = if args.film.is_some() {
        &[]
    } else {
        &args.output[..]
    };
    let mut outputs = Outputs::new(pictures, args.files, args.resolve)?;
    aovs::check_files(args)?;
    for path in [&args.checkpoint, &args.stats, &args.log, &args.film]
        .into_iter()
        .flatten()
    {
        can_write(path).output()?;
    }
    check_files(args)?;
    super::set_threads(args.threads)?;
    if args.film.is_some() {
        part::check(args)?;
    }
    let stop = Stop::listen();
    let mut method = job::method(args)?;
    if method.table_scenes == Some(1) {
        tracing::warn!(
            "--opsr-table: a table of one scene, such as --preset smoke learns, suits no other"
        );
    }
    if method.rule.table().is_some() && args.scene.has_ggx_lobes() {
        tracing::warn!("--distribution ggx: tables are learned for Beckmann lobes");
    }
    let opened = args.scene.open()?;
    if opened.scene.lights().is_empty() {
        let what = "nothing lights the scene: --env studio, --env sky or a map would";
        let scene = args.scene.scene.display();
        return Err(anyhow!("{scene}: {what}")).input();
    }
    if opened.in_studio {
        outputs.never_brighten();
    }
    stop.begin();
    let mut kind = args.method.integrator;
    let settings = if kind == IntegratorKind::Auto {
        let Some((contender, its_method)) = auto::choose(args, &opened, &stop)? else {
            return Ok(stopped_in_pilot());
        };
        (kind, method) = (contender.kind, its_method);
        contender.settings
    } else {
        let mut settings = job::settings(args, &method);
        settings.levels = job::levels(args, &settings, opened.scene.has_lobes())?;
        settings
    };
    let pilot = begun.elapsed();
    aovs::check(args, &settings)?;
    let scene = args.scene.scene.display().to_string();
    let table = method.table_sha256.as_deref();
    let mut fixed = settings.metadata(&scene, &opened.hash, table);
    let words = args.method.words(kind);
    fixed.extend(words.map(|(key, value)| (key.to_owned(), value)));
    let provenance = Provenance {
        command: std::env::args().collect::<Vec<_>>().join(" "),
        scene,
        fixed,
        settings: job::words(args, kind),
        reproducible: args.reproducible,
    };
    RenderJob {
        args,
        outputs,
        opened,
        settings,
        provenance,
        stop,
        pilot,
    }
    .run()
}

/// Size of the whole picture, and the camera with its lens.
pub(super) fn frame_and_camera(
    args: &RenderArgs,
    opened: &Opened,
) -> anyhow::Result<(UVec2, Camera)> {
    let size = frame(args.size, args.camera.as_deref(), opened)?;
    let aspect = size.x as f32 / size.y as f32;
    let camera = scene::camera(&opened.scene, args.camera.as_deref(), aspect)?;
    Ok((size, args.lens.on(camera)?))
}

/// Size of the whole picture of a camera.
pub(super) fn frame(
    size: Option<Size>,
    camera: Option<&str>,
    opened: &Opened,
) -> anyhow::Result<UVec2> {
    let share = match size {
        Some(Size::Pixels(size)) => return Ok(size),
        Some(Size::Share(share)) => share,
        None => 1.0,
    };
    let camera = scene::camera(&opened.scene, camera, 1.0)?;
    let whole = camera.default_frame();
    let scaled = |side: u32| ((share * f64::from(side)).round() as u32).clamp(1, 65536);
    Ok(UVec2::new(scaled(whole.x), scaled(whole.y)))
}

/// Refuses a picture of a window that needs more memory than there is.
pub(super) fn check_memory(
    args: &RenderArgs,
    settings: &Settings,
    frame: UVec2,
    window: Window,
) -> anyhow::Result<()> {
    let levels = settings.levels.len();
    let mut bytes = settings.bytes(frame, window, aovs::recorded(args));
    if args.resolve.level_layers {
        bytes += (window.len() * levels) as u64 * LEVEL_LAYER_BYTES;
    }
    // Chains move over the whole frame.
    let (size, hint) = match settings.estimator {
        Estimator::Mlt { .. } => (frame, "--size makes the picture smaller"),
        _ => (
            UVec2::new(window.w, window.h),
            "--crop renders a part of a picture",
        ),
    };
    let pixels = format!("{}x{} pixels", size.x, size.y);
    let with_levels = format!("{pixels} of {levels} levels");
    memory::check(if levels > 0 { with_levels } else { pixels }, bytes)
        .map_err(|e| anyhow!("{e}; {hint}"))
        .blame(Exit::Memory)
}

/// Says that there is nothing to save.
fn stopped_in_pilot() -> Exit {
    eprintln!("opsr: stopped before the first sample; nothing was written");
    Exit::Stopped
}

/// Refuses outputs of which two are one file, or one is a file that is read.
fn check_files(args: &RenderArgs) -> anyhow::Result<()> {
    let others = [&args.checkpoint, &args.stats, &args.log, &args.film];
    let outputs = args.output.iter().chain(others.into_iter().flatten());
    let environment = args.scene.environment();
    let inputs = [
        environment.as_ref(),
        args.reference.as_ref(),
        args.method.table.as_ref(),
    ];
    let inputs = inputs.into_iter().flatten().chain([&args.scene.scene]);
    check_distinct(
        &outputs.map(PathBuf::as_path).collect::<Vec<_>>(),
        &inputs.map(PathBuf::as_path).collect::<Vec<_>>(),
    )
}

/// Bytes that a layer of its own adds for each pixel of a level.
const LEVEL_LAYER_BYTES: u64 = 36;

/// Everything a render needs.
pub(super) struct RenderJob<'a> {
    pub(super) args: &'a RenderArgs,
    pub(super) outputs: Outputs,
    pub(super) opened: Opened,
    pub(super) settings: Settings,
    pub(super) provenance: Provenance,
    pub(super) stop: Stop,
    /// Time that loading and pilots took, which --time counts.
    pilot: Duration,
}

impl RenderJob<'_> {
    fn run(&self) -> anyhow::Result<Exit> {
        let args = self.args;
        let (size, camera) = frame_and_camera(args, &self.opened)?;
        let checked = self.settings.check_scene(&self.opened.scene, &camera);
        checked.map_err(|what| anyhow!(what)).usage()?;
        if let Some(pixel) = args.trace_pixel {
            let view = View::new(&self.opened.scene, &camera, size, Window::full(size));
            trace::run(args, &self.settings, &view, pixel)?;
            return Ok(Exit::Done);
        }
        if let Some(path) = &args.film {
            return self.part(path, &camera, size);
        }
        let fingerprint = self.fingerprint(size, args.crop.map(|crop| crop.of(size)));
        let (mut picture, start, spent) = self.start(size, &fingerprint)?;
        let asked = self.stop.flag();
        let ends = integrator::Stop::when(&asked);
        let film = picture.film.window;
        let view = View::new(&self.opened.scene, &camera, size, film).until(&ends);
        let run = Run {
            camera: &camera,
            fingerprint,
            start,
            spent,
        };
        let mut listener = Listener::open(self, run, &picture, &view)?;
        let mut integrator = self.settings.integrator();
        if let Some(notes) = integrator.notes(&view) {
            tracing::info!("{notes}");
        }
        let hear =
            &mut |progress: &RenderProgress, picture: &Picture| listener.hear(progress, picture);
        let budget = self.budget();
        let (progress, reason) = drive(&mut *integrator, &view, &budget, start, &mut picture, hear);
        if progress.samples == 0 {
            tracing::warn!(
                "stopped within the first sample: the picture holds what was done of it, and no checkpoint is made"
            );
        }
        let missing = missing_light(&view, &self.settings, &picture, progress.samples);
        let Closed {
            written,
            true_error,
            failed,
        } = listener.close(&progress, &picture, missing.as_ref())?;
        let ended = Ended {
            film: &picture.film,
            progress: &progress,
            start,
            camera: &camera,
            exposure: written.exposure,
            error: (missing.as_ref()).map_or(written.error, |m| m.error(written.error)),
            missing: missing.as_ref(),
            unseen: unseen_share(&picture),
            black: written.shown.pixels.iter().all(|p| *p == Rgb::ZERO),
            true_error,
        };
        if let Some(path) = &args.stats {
            let text = format!("{:#}\n", self.statistics(&ended, spent));
            files::write_bytes(path, text).output()?;
        }
        if let Some(error) = failed {
            return Err(error);
        }
        self.report(&ended);
        Ok(if reason == Reason::Stopped {
            Exit::Stopped
        } else {
            Exit::Done
        })
    }

    fn budget(&self) -> Budget {
        let RenderArgs {
            spp,
            time,
            target_error,
            ..
        } = *self.args;
        let free = spp.is_none() && time.is_none() && target_error.is_none();
        let samples = if free { Some(DEFAULT_SPP) } else { spp };
        Budget {
            samples,
            time: time.map(|time| left_after(time, self.pilot)),
            error: target_error.map(|bound| ErrorBound {
                bound: bound.into(),
                estimate: stopping_error,
            }),
        }
    }

    /// The identity of this render, which its checkpoints carry, and its parts without their crop.
    pub(super) fn fingerprint(&self, size: UVec2, crop: Option<Window>) -> Fingerprint {
        fingerprint(self.args, &self.opened, &self.settings, size, crop)
    }

    /// The picture to continue, the number of its samples, and the seconds spent on them.
    fn start(&self, size: UVec2, ours: &Fingerprint) -> anyhow::Result<(Picture, u32, f64)> {
        let args = self.args;
        let window = job::window(args, size);
        Film::check(size, window)
            .context(job::window_option(args))
            .usage()?;
        check_memory(args, &self.settings, size, window)?;
        if let Some(path) = &args.checkpoint {
            if args.resume {
                let old = Checkpoint::load(path, ours).input()?;
                return Ok((old.picture, old.samples, old.seconds));
            }
            if path.exists() {
                let path = path.display();
                let what = "exists: --resume continues from it; remove it to begin anew";
                return Err(anyhow!("{path} {what}")).usage();
            }
        }
        let levels = self.settings.levels.len();
        if levels > 0 {
            let bytes = LevelFilm::bytes(window.len(), levels);
            tracing::info!("{levels} levels take {} MB", bytes / 1_000_000);
        }
        let picture = Picture::blank(size, window, levels, aovs::recorded(args)).usage()?;
        Ok((picture, 0, 0.0))
    }

    /// Reports what was written with the statistics of the render, and the refused samples.
    fn report(&self, ended: &Ended<'_>) {
        let Ended { film, progress, .. } = ended;
        let seconds = progress.elapsed.as_secs_f64();
        let rate = match ended.paths() {
            0 if progress.samples == 0 => "a part of the first sample".to_owned(),
            0 => "no new samples: the checkpoint has as many as were asked for, or more".to_owned(),
            paths => format!("{:.3} million paths/s", paths as f64 / seconds / 1e6),
        };
        let exposure = (ended.exposure).map_or(String::new(), |e| format!(", exposure {e:+}"));
        let camera = match self.opened.scene.parts().cameras.is_empty() {
            true => format!(", {}, since the file has no camera", ended.camera.name),
            false => String::new(),
        };
        let studio = match self.opened.in_studio {
            true => ", lit by the built-in studio, since the file has no light",
            false => "",
        };
        let mut error = match ended.error {
            error if error.is_finite() => format!(", estimated relative error {error:.4}"),
            _ => String::new(),
        };
        if ended.unseen >= 0.0005 {
            let percent = 100.0 * ended.unseen;
            error += &format!(", {percent:.1} % of the light found by roughened lobes alone");
        }
        if let Some(missing) = ended.missing {
            error += &format!(", {missing}");
        }
        let truth = (ended.true_error).map_or(String::new(), |e| format!(", true error {e:.4}"));
        let summary = format!(
            "{}: {}x{}{exposure}{camera}{studio}, {} spp in {seconds:.2} s, {rate}{error}{truth}",
            self.outputs.names(),
            film.window.w,
            film.window.h,
            progress.samples
        );
        match self.args.progress {
            Style::Auto => eprintln!("{summary}"),
            Style::Json | Style::None => tracing::info!("{summary}"),
        }
        for line in super::info::unused(&self.opened.scene, &self.settings.rule) {
            tracing::info!("{line}");
        }
        let clipped = film.clipped_variances();
        if clipped > 0 {
            tracing::warn!(
                "{clipped} pixels have a variance above {:e}, which is written in its place: the light is too strong for \
                 error estimates in single precision",
                f32::MAX
            );
        }
        if ended.black && !self.opened.scene.lights().is_empty() {
            tracing::warn!(
                "the picture is black: no path has found light; `opsr info` names an integrator for the scene's lights and \
                 materials"
            );
        }
        let rejected = &film.rejected;
        if rejected.total() > 0 {
            let first = rejected.first.iter().map(|r| {
                format!(
                    "--crop {},{},1,1 --seed {} sample {}",
                    r.pixel.x, r.pixel.y, self.settings.seed, r.sample
                )
            });
            tracing::warn!(
                "{} samples were refused ({} not a number, {} infinite); the first: {}",
                rejected.total(),
                rejected.nan,
                rejected.infinite,
                first.collect::<Vec<_>>().join("; ")
            );
        }
    }

    /// Statistics for programs.
    fn statistics(&self, ended: &Ended<'_>, spent: f64) -> serde_json::Value {
        let Ended { film, progress, .. } = ended;
        let seconds = progress.elapsed.as_secs_f64();
        let scene = &self.opened.scene;
        let settings = self.provenance.settings.iter();
        let settings = settings.map(|(key, value)| ((*key).to_owned(), value.clone().into()));
        let Window { x, y, w, h } = film.window;
        let finite = |x: f64| x.is_finite().then_some(x);
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "command": self.provenance.command,
            "settings": serde_json::Map::from_iter(settings),
            "seed": self.settings.seed,
            "files": self.args.output,
            "scene": {
                "file": self.provenance.scene,
                "sha256": self.opened.hash,
                "triangles": scene.geometry().len(),
                "emissive_triangles": scene.lights().emissive_triangles(),
                "materials": scene.parts().materials.len(),
            },
            "camera": ended.camera.name,
            "frame": [film.size.x, film.size.y],
            "window": [x, y, w, h],
            "threads": rayon::current_num_threads(),
            "spp": progress.samples,
            "seconds": seconds,
            "seconds_of_earlier_runs": spent,
            "paths": ended.paths(),
            "paths_per_second": finite(ended.paths() as f64 / seconds),
            "relative_error": finite(ended.error),
            "light_missing": ended.missing.map(|m| {
                serde_json::json!({ "share": m.share, "pixel": m.pixel.to_array(), "finder": m.finder.name() })
            }),
            "true_error": ended.true_error.and_then(finite),
            "exposure": ended.exposure,
            "refused": { "nan": film.rejected.nan, "infinite": film.rejected.infinite },
            "clipped_variances": film.clipped_variances(),
        })
    }
}

/// The identity of a render with these settings.
pub(super) fn fingerprint(
    args: &RenderArgs,
    opened: &Opened,
    settings: &Settings,
    size: UVec2,
    crop: Option<Window>,
) -> Fingerprint {
    let settings = format!(
        "{}, {}x{}, crop {crop:?}, camera {:?}, aov {:?}, {}",
        settings.fingerprint(),
        size.x,
        size.y,
        args.camera,
        aovs::recorded(args),
        args.scene.words() + &args.lens.words(),
    );
    Fingerprint {
        version: env!("CARGO_PKG_VERSION").into(),
        scene: opened.hash.clone(),
        settings,
    }
}

/// A render that has ended.
struct Ended<'a> {
    film: &'a Film,
    progress: &'a RenderProgress,
    /// Samples of an earlier run, which took no time of this one.
    start: u32,
    camera: &'a Camera,
    exposure: Option<f32>,
    /// Estimated relative error.
    error: f64,
    /// Light that a witness found and the picture lacks.
    missing: Option<&'a Missing>,
    /// Share of the light that roughened lobes alone found.
    unseen: f64,
    /// True if the picture has no light at all.
    black: bool,
    true_error: Option<f64>,
}

impl Ended<'_> {
    /// Paths of this run.
    fn paths(&self) -> u64 {
        u64::from(self.progress.samples - self.start) * self.film.pixels.len() as u64
    }
}
