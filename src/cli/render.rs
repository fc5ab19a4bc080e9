//! `opsr render`: a glTF scene in, a picture out.

use super::bar::{Bar, Style};
use super::live::Live;
use super::output::{Outputs, Provenance, can_write};
use super::scene::{self, Opened, SceneArgs};
use super::stop::Stop;
use super::{Blame, Exit, job, tune};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use opsr::image::film::{Film, Window};
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::drive::{Budget, Progress, Reason, drive};
use opsr::integrator::{FirstHit, Picture, Settings};
use opsr::math::UVec2;
use opsr::regularise::Lookup;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Options of `opsr render`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,

    /// Where the picture goes: .exr (linear, with variance and other layers) or .png; may be given several times.
    #[arg(short, long, value_name = "FILE", default_value = "out.exr")]
    output: Vec<PathBuf>,

    /// Samples per pixel. Without --spp, --time and --target-error: 128.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) spp: Option<u32>,
    /// Stop after this long, such as 60s or 5min.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(super) time: Option<Duration>,
    /// Stop when the estimated relative error of the picture (root of its relMSE) is below this.
    #[arg(long, value_name = "X", value_parser = scene::positive)]
    pub(super) target_error: Option<f32>,

    /// Size of the picture; without it 512 rows, as wide as the camera asks for.
    #[arg(long, value_name = "WxH", value_parser = job::size)]
    pub(super) size: Option<UVec2>,
    /// Render only this part of the picture.
    #[arg(long, value_name = "X,Y,W,H", value_parser = job::window)]
    crop: Option<Window>,
    /// Camera by name or number (from 0).
    #[arg(long, value_name = "NAME")]
    pub(super) camera: Option<String>,

    /// Learned attenuation factors.
    #[arg(long, value_name = "FILE", conflicts_with = "gamma")]
    pub(super) opsr_table: Option<PathBuf>,
    /// Multiply the table's factors by this, instead of the scale that the table carries; `auto` finds it from a pilot
    /// of some hundred thousand paths for the number of samples asked for.
    #[arg(long, value_name = "X|auto", requires = "opsr_table", value_parser = job::scale)]
    pub(super) table_scale: Option<job::Scale>,
    /// How factors are looked up, instead of the way that the table was learned for.
    #[arg(long, value_enum, requires = "opsr_table")]
    pub(super) lookup: Option<LookupArg>,
    /// One attenuation factor in [0, 1] for all paths, instead of a table; 0 is plain path tracing.
    #[arg(long, value_name = "X", value_parser = unit)]
    pub(super) gamma: Option<f32>,
    /// How regularisation is done.
    #[arg(long, value_enum, default_value_t)]
    pub(super) mode: Mode,
    /// Filter value of --mode filter-glossy.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = scene::positive)]
    pub(super) filter: f32,
    /// Let the bias vanish: sample n roughens by n^-LAMBDA of the full amount, LAMBDA in (0, 0.5).
    #[arg(long, value_name = "LAMBDA", num_args = 0..=1, default_missing_value = "0.16666667", value_parser = exponent)]
    pub(super) consistent: Option<f32>,

    /// Surfaces that the longest path scatters from.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(super) max_depth: u32,
    /// Seed of all random numbers: the same seed gives the same picture to the bit.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Threads; without it as many as there are cores. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,

    /// Add albedo, normal and depth layers to EXR files.
    #[arg(long)]
    aov: bool,
    /// Brighten PNG files by this many stops.
    #[arg(
        long,
        value_name = "STOPS",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        value_parser = scene::finite
    )]
    exposure: f32,
    /// Leave times out of the files, so that equal renders are equal files.
    #[arg(long)]
    reproducible: bool,

    /// How progress is shown.
    #[arg(long, value_enum, default_value_t)]
    progress: Style,
    /// Write the picture so far this often.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    save_every: Option<Duration>,
    /// Keep the state of the render in this file, at the end and as often as --save-every says (or every minute).
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Go on from the checkpoint; one of another scene or of other settings is refused.
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// Show the picture in the viewer tev while it is made.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:14158")]
    tev: Option<String>,
}

const EXAMPLES: &str = "Examples:
  opsr render scene.glb --opsr-table params/beta-0.001.json -o out.exr -o out.png
  opsr render scene.glb --time 60s --size 1280x720 --env sky.hdr -o out.png
  opsr render scene.glb --spp 4096 --checkpoint night.ckpt -o out.exr
  opsr render scene.glb --spp 8192 --checkpoint night.ckpt --resume -o out.exr";

/// How regularisation is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Mode {
    /// At next-event estimation only; the path goes on with the original lobe.
    #[default]
    Default,
    /// The path goes on with the regularised lobe: faster, slightly more bias.
    Reuse,
    /// pbrt-v4's rule, for comparison.
    Pbrt,
    /// Cycles' filter glossy, for comparison.
    FilterGlossy,
    /// No lobe sharper than the roughest before it, for comparison.
    RoughnessClamp,
    /// Kaplanyan and Dachsbacher's mollifier: lights without area seen through smooth mirrors and glass.
    Mollifier,
}

/// [`Lookup`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LookupArg {
    /// The factor of the path's class.
    Nearest,
    /// Between neighbouring classes: continuous in every roughness.
    Linear,
}

impl From<LookupArg> for Lookup {
    fn from(lookup: LookupArg) -> Self {
        match lookup {
            LookupArg::Nearest => Self::Nearest,
            LookupArg::Linear => Self::Linear,
        }
    }
}

fn unit(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("expected a number from 0 to 1".into()),
    }
}

fn exponent(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if x > 0.0 && x < 0.5 => Ok(x),
        _ => Err("expected a number between 0 and 0.5".into()),
    }
}

/// How often a checkpoint is written if nothing else is said.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Samples of a render whose budget is not given.
pub(super) const DEFAULT_SPP: u32 = 128;

/// Runs the command.
pub(super) fn run(args: &RenderArgs) -> anyhow::Result<Exit> {
    let outputs = Outputs::new(&args.output, args.exposure)?;
    if let Some(path) = &args.checkpoint {
        can_write(path).output()?;
    }
    if let Some(threads) = args.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads));
        pool.build_global()
            .context("cannot start that many threads")?;
    }
    let chosen = job::method(args)?;
    let opened = args.scene.open()?;
    let mut settings = job::settings(args, chosen.method);
    if args.table_scale == Some(job::Scale::Auto) {
        tune::tune(args, &opened, &mut settings)?;
    }
    let provenance = Provenance {
        command: std::env::args().collect::<Vec<_>>().join(" "),
        seed: args.seed,
        scene: args.scene.scene.display().to_string(),
        scene_hash: opened.hash.clone(),
        table_hash: chosen.table_hash.clone(),
        reproducible: args.reproducible,
    };
    Job {
        args,
        outputs,
        opened,
        settings,
        provenance,
    }
    .run()
}

/// Everything a render needs.
struct Job<'a> {
    args: &'a RenderArgs,
    outputs: Outputs,
    opened: Opened,
    settings: Settings,
    provenance: Provenance,
}

impl Job<'_> {
    fn run(&self) -> anyhow::Result<Exit> {
        let args = self.args;
        let size = tune::size(args, &self.opened)?;
        let aspect = size.x as f32 / size.y as f32;
        let camera = scene::camera(&self.opened.scene, args.camera.as_deref(), aspect)?;
        let fingerprint = self.fingerprint(size);
        let (mut picture, start, spent) = self.start(size, &fingerprint)?;
        let mut live = match &args.tev {
            Some(address) => Some(Live::open(address, "opsr", &picture.film.mean())?),
            None => None,
        };
        let budget = self.budget();
        let stop = Stop::listen();
        let bar = Bar::new(args.progress);
        let checkpoint = |progress: &Progress, picture: &Picture| -> anyhow::Result<()> {
            let Some(path) = &args.checkpoint else {
                return Ok(());
            };
            let (fingerprint, picture) = (fingerprint.clone(), picture.clone());
            let seconds = spent + progress.elapsed.as_secs_f64();
            Checkpoint {
                fingerprint,
                samples: progress.samples,
                seconds,
                picture,
            }
            .save(path)
            .output()
        };
        let mut saved = Instant::now();
        let mut trouble = None;
        let mut listener = |progress: &Progress, picture: &Picture| {
            bar.show(progress);
            if let Some(view) = &mut live
                && let Err(error) = view.show(&picture.film.mean())
            {
                tracing::warn!("tev went away: {error:#}");
                live = None;
            }
            let every = args
                .save_every
                .or(args.checkpoint.as_ref().map(|_| CHECKPOINT_EVERY));
            if every.is_some_and(|every| saved.elapsed() >= every) {
                saved = Instant::now();
                let partial = match args.save_every {
                    Some(_) => self.write(picture, progress, spent),
                    None => Ok(()),
                };
                if let Err(error) = partial.and_then(|()| checkpoint(progress, picture)) {
                    trouble = Some(error);
                    return ControlFlow::Break(());
                }
            }
            if stop.asked() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let integrator = self.settings.integrator();
        let scene = &self.opened.scene;
        let (progress, reason) = drive(
            &*integrator,
            scene,
            &camera,
            &budget,
            start,
            &mut picture,
            &mut listener,
        );
        bar.finish();
        if let Some(error) = trouble {
            return Err(error.context("could not save the picture so far"));
        }
        // What cannot be saved in one place is still saved in the other.
        let kept = checkpoint(&progress, &picture);
        self.write(&picture, &progress, spent)?;
        kept?;
        self.report(&picture, &progress);
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
            time,
            error: target_error.map(f64::from),
        }
    }

    /// What a checkpoint of this render must say.
    fn fingerprint(&self, size: UVec2) -> Fingerprint {
        let Settings {
            method,
            max_vertices,
            roulette_start,
            seed,
        } = &self.settings;
        let args = self.args;
        let table = self.provenance.table_hash.as_deref();
        // A table is named by its hash, not by 1360 numbers.
        let method = match (method, table) {
            (
                opsr::integrator::Method::Table {
                    table,
                    reuse,
                    lambda,
                },
                Some(hash),
            ) => {
                format!(
                    "table {hash} {:?} {} {reuse} {lambda}",
                    table.lookup, table.scale
                )
            }
            (method, _) => format!("{method:?}"),
        };
        let settings = format!(
            "{method}, {max_vertices} vertices, roulette {roulette_start}, seed {seed}, {}x{}, crop {:?}, camera {:?}, aov {}, {}",
            size.x,
            size.y,
            args.crop,
            args.camera,
            args.aov,
            args.scene.words(),
        );
        Fingerprint {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: self.opened.hash.clone(),
            settings,
        }
    }

    /// The picture to go on with, the number of its samples, and the seconds spent on them.
    fn start(&self, size: UVec2, ours: &Fingerprint) -> anyhow::Result<(Picture, u32, f64)> {
        let args = self.args;
        if let Some(path) = &args.checkpoint {
            if args.resume {
                let old = Checkpoint::load(path, ours).input()?;
                return Ok((old.picture, old.samples, old.seconds));
            }
            if path.exists() {
                let path = path.display();
                let what = "exists: --resume goes on from it; remove it to begin anew";
                return Err(anyhow!("{path} {what}")).usage();
            }
        }
        let window = args.crop.unwrap_or(Window::full(size));
        let film = Film::cropped(size, window).context("--crop").usage()?;
        let aovs = args.aov.then(|| FirstHit::new(window));
        Ok((Picture { film, aovs }, 0, 0.0))
    }

    fn write(&self, picture: &Picture, progress: &Progress, spent: f64) -> anyhow::Result<()> {
        let seconds = spent + progress.elapsed.as_secs_f64();
        let threads = rayon::current_num_threads();
        self.outputs.write(
            picture,
            &self.provenance.metadata(progress.samples, seconds, threads),
        )
    }

    /// Says what was done, and what was refused.
    fn report(&self, picture: &Picture, progress: &Progress) {
        let film = &picture.film;
        let seconds = progress.elapsed.as_secs_f64();
        let paths = film.pixels.iter().map(|p| f64::from(p.n)).sum::<f64>();
        tracing::info!(
            "{} spp in {seconds:.2} s, {:.3} million paths/s, estimated relative error {:.4}",
            progress.samples,
            paths / seconds / 1e6,
            film.relative_error()
        );
        for line in super::info::unused(&self.opened.scene, &self.settings.method) {
            tracing::info!("{line}");
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
