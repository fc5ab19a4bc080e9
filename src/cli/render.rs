//! `opsr render`: a glTF scene in, a picture out.

use super::bar::{Bar, Style};
use super::live::Live;
use super::output::{Outputs, Provenance, Written, can_write};
use super::render_args::RenderArgs;
use super::scene::{self, Opened};
use super::stop::Stop;
use super::{Blame, Exit, job, tune};
use anyhow::{Context, anyhow};
use opsr::image::film::{Film, Window};
use opsr::image::level_film::LevelFilm;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::drive::{Budget, ErrorBound, Reason, RenderProgress, drive};
use opsr::integrator::{FirstHit, Picture, Settings, View};
use opsr::math::UVec2;
use opsr::memory;
use opsr::regularise::AttenuationTable;
use opsr::tune::resolve::{relative_error, unseen_share};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Interval of checkpoints unless another is asked for.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Samples of a render whose budget is not given.
pub(super) const DEFAULT_SPP: u32 = 128;

/// Runs the command.
pub(super) fn run(args: &RenderArgs) -> anyhow::Result<Exit> {
    let outputs = Outputs::new(&args.output, args.display, args.resolve)?;
    if let Some(path) = &args.checkpoint {
        can_write(path).output()?;
    }
    super::set_threads(args.threads)?;
    let stop = Stop::listen();
    let method = job::method(args)?;
    let opened = args.scene.open()?;
    stop.begin();
    let mut settings = job::settings(args, &method);
    if args.table_scale == Some(job::Scale::Auto)
        && !tune::tune(args, &opened, &mut settings, &stop)?
    {
        return Ok(Exit::Stopped);
    }
    settings.levels = job::levels(args, &settings, opened.scene.has_lobes())?;
    let provenance = Provenance {
        command: std::env::args().collect::<Vec<_>>().join(" "),
        seed: args.seed,
        scene: args.scene.scene.display().to_string(),
        scene_hash: opened.hash.clone(),
        table_hash: method.table_sha256,
        levels: settings.levels.clone(),
        table_tuning: settings.rule.table().map(AttenuationTable::tuning),
        reproducible: args.reproducible,
    };
    RenderJob {
        args,
        outputs,
        opened,
        settings,
        provenance,
        stop,
    }
    .run()
}

/// Bytes of a pixel: moments, their copy in tiles, the layers that are written. Measured: 192.
const FILM_BYTES: u64 = 205;
/// The same of albedo, normal and depth. Measured: 181.
const AOV_BYTES: u64 = 195;
/// The same of a level; measured: 87. A layer of its own adds 36.
const LEVEL_BYTES: u64 = 96;
const LEVEL_LAYER_BYTES: u64 = 36;

/// Everything a render needs.
struct RenderJob<'a> {
    args: &'a RenderArgs,
    outputs: Outputs,
    opened: Opened,
    settings: Settings,
    provenance: Provenance,
    stop: Stop,
}

impl RenderJob<'_> {
    fn run(&self) -> anyhow::Result<Exit> {
        let args = self.args;
        let size = tune::size(args, &self.opened)?;
        let aspect = size.x as f32 / size.y as f32;
        let camera = scene::camera(&self.opened.scene, args.camera.as_deref(), aspect)?;
        let fingerprint = self.fingerprint(size);
        let (mut picture, start, spent) = self.start(size, &fingerprint)?;
        let live = match &args.tev {
            Some(address) => Some(Live::open(address, "opsr", &picture.film.mean())?),
            None => None,
        };
        let budget = self.budget();
        let bar = Bar::new(args.progress);
        let checkpoint = |progress: &RenderProgress, picture: &Picture| -> anyhow::Result<()> {
            let Some(path) = &args.checkpoint else {
                return Ok(());
            };
            let (fingerprint, picture) = (fingerprint.clone(), picture.clone());
            let seconds = spent + progress.elapsed.as_secs_f64();
            Checkpoint {
                fingerprint,
                samples: progress.samples,
                seconds,
                levels: self.settings.levels.clone(),
                picture,
            }
            .save(path)
            .output()
        };
        let mut saved = Instant::now();
        let mut trouble = None;
        let mut listener = |progress: &RenderProgress, picture: &Picture| {
            bar.show(progress);
            if let Some(view) = &live {
                view.show(args.resolve.shown(picture));
            }
            let every = args
                .save_every
                .or(args.checkpoint.as_ref().map(|_| CHECKPOINT_EVERY));
            if every.is_some_and(|every| saved.elapsed() >= every) {
                saved = Instant::now();
                let partial = match args.save_every {
                    Some(_) => self.write(picture, progress, spent).map(|_| ()),
                    None => Ok(()),
                };
                if let Err(error) = partial.and_then(|()| checkpoint(progress, picture)) {
                    trouble = Some(error);
                    return ControlFlow::Break(());
                }
            }
            self.stop.flow()
        };
        let view = View::of(&self.opened.scene, &camera, &picture.film);
        let (progress, reason) = drive(
            &mut *self.settings.integrator(),
            &view,
            &budget,
            start,
            &mut picture,
            &mut listener,
        );
        bar.finish();
        if let Some(error) = trouble {
            return Err(error.context("could not save the picture so far"));
        }
        // If one of the two cannot be saved, the other still is.
        let kept = checkpoint(&progress, &picture);
        let written = self.write(&picture, &progress, spent)?;
        kept?;
        if let Some(view) = live {
            view.finish();
        }
        self.report(&picture, &progress, start, &written);
        Ok(if reason == Reason::Stopped {
            Exit::Stopped
        } else {
            Exit::Done
        })
    }

    /// Refuses a picture that needs more memory than there is.
    fn check_memory(&self, window: Window) -> anyhow::Result<()> {
        let args = self.args;
        let mut each = LEVEL_BYTES;
        if args.resolve.level_layers {
            each += LEVEL_LAYER_BYTES;
        }
        let aovs = if args.aov { AOV_BYTES } else { 0 };
        let levels = self.settings.levels.len() as u64;
        let bytes = window.len() as u64 * (FILM_BYTES + aovs + levels * each);
        let pixels = format!("{}x{} pixels", window.w, window.h);
        let with_levels = format!("{pixels} of {levels} levels");
        memory::check(if levels > 0 { with_levels } else { pixels }, bytes)
            .map_err(|e| anyhow!("{e}; --crop renders a part of a picture"))
            .blame(Exit::Memory)
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
            time,
            error: target_error.map(|bound| ErrorBound {
                bound: bound.into(),
                estimate: relative_error,
            }),
        }
    }

    /// The identity of this render, which its checkpoints carry.
    fn fingerprint(&self, size: UVec2) -> Fingerprint {
        let args = self.args;
        let settings = format!(
            "{}, {}x{}, crop {:?}, camera {:?}, aov {}, {}",
            self.settings.fingerprint(),
            size.x,
            size.y,
            args.crop,
            args.camera,
            args.aov || args.resolve.denoise,
            args.scene.words(),
        );
        Fingerprint {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: self.opened.hash.clone(),
            settings,
        }
    }

    /// The picture to continue, the number of its samples, and the seconds spent on them.
    fn start(&self, size: UVec2, ours: &Fingerprint) -> anyhow::Result<(Picture, u32, f64)> {
        let args = self.args;
        let window = args.crop.unwrap_or(Window::full(size));
        Film::check(size, window)
            .context(job::window_option(args))
            .usage()?;
        self.check_memory(window)?;
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
        let film = Film::cropped(size, window).usage()?;
        let aovs = (args.aov || args.resolve.denoise).then(|| FirstHit::new(window));
        let levels = self.settings.levels.len();
        if levels > 0 {
            let bytes = LevelFilm::bytes(window.len(), levels);
            tracing::info!("{levels} levels take {} MB", bytes / 1_000_000);
        }
        let levels = (levels > 0).then(|| LevelFilm::new(size, window, levels));
        Ok((Picture { film, aovs, levels }, 0, 0.0))
    }

    /// Writes the files; the estimated relative error of the picture.
    fn write(
        &self,
        picture: &Picture,
        progress: &RenderProgress,
        spent: f64,
    ) -> anyhow::Result<Written> {
        let seconds = spent + progress.elapsed.as_secs_f64();
        let threads = rayon::current_num_threads();
        let metadata = self.provenance.metadata(progress.samples, seconds, threads);
        self.outputs.write(picture, &metadata)
    }

    /// Reports what was written with the statistics of the render, and the refused samples.
    fn report(&self, picture: &Picture, progress: &RenderProgress, start: u32, written: &Written) {
        let film = &picture.film;
        let seconds = progress.elapsed.as_secs_f64();
        // Samples of an earlier run took no time of this one.
        let paths = f64::from(progress.samples - start) * film.pixels.len() as f64;
        let rate = if paths > 0.0 {
            format!("{:.3} million paths/s", paths / seconds / 1e6)
        } else {
            "no new samples: the checkpoint has as many as were asked for, or more".to_owned()
        };
        let mut error = match written.error {
            error if error.is_finite() => format!(", estimated relative error {error:.4}"),
            _ => String::new(),
        };
        let unseen = 100.0 * unseen_share(picture);
        if unseen >= 0.05 {
            error += &format!(", {unseen:.1} % of the light found by roughened lobes alone");
        }
        let exposure =
            (written.exposure).map_or(String::new(), |stops| format!(", exposure {stops:+}"));
        let summary = format!(
            "{}: {}x{}{exposure}, {} spp in {seconds:.2} s, {rate}{error}",
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
}
