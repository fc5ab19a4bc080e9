//! `opsr scenes reference`: renders every crop of a manifest to a given noise.

use super::exit::{Blame, Exit, Failure};
use super::options::positive;
use super::output::{note, print};
use super::stop::Stop;
use anyhow::anyhow;
use opsr::scene::Scene;
use opsr::scene::load::{LoadOptions, load};
use opsr_train::manifest::{Manifest, SceneEntry};
use opsr_train::reference::{Reference, SEED};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Options of `opsr scenes reference`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ReferenceArgs {
    /// The list of scenes; references go into the folder `references` beside it.
    #[arg(
        long,
        value_name = "FILE",
        default_value = "training_scenes/manifest.toml"
    )]
    manifest: PathBuf,
    /// Only this scene; may be given several times.
    #[arg(long = "scene", value_name = "NAME")]
    scenes: Vec<String>,
    /// Largest number of samples per pixel, including those already in the files.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: Option<u32>,
    /// Finish a crop when its noise (mean relative standard error of its pixels) is below this [default without --spp and
    /// --time: 0.01].
    #[arg(long, value_name = "X", value_parser = positive)]
    target_noise: Option<f32>,
    /// Stop after this total time, such as 10min.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    time: Option<Duration>,
    /// Seed of all random numbers. Do not render or train with it: pictures would share samples with their reference.
    #[arg(long, value_name = "N", default_value_t = SEED)]
    seed: u64,
    /// Number of threads [default: number of cores]. The references do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

/// Default of the target noise.
const TARGET: f32 = 0.01;

/// Samples of the first and of the longest pass: every crop gets a file early, and passes end soon after a stop signal.
const PASS: std::ops::RangeInclusive<u32> = 64..=1024;

/// Least samples for a noise estimate: with fewer, some light may not have been found.
const TRUSTED: u32 = 1024;

/// A crop and its reference in progress.
struct Work<'a> {
    entry: &'a SceneEntry,
    crop: [u32; 2],
    scene: usize,
    reference: Reference,
    noise: f64,
}

impl Work<'_> {
    fn label(&self) -> String {
        format!("{} {},{}", self.entry.name, self.crop[0], self.crop[1])
    }

    /// Samples of the next pass; `None` when the crop is done.
    fn pass(&self, spp: u32, target: f64) -> Option<u32> {
        let done = self.reference.samples();
        if done >= spp || (done >= TRUSTED && self.noise <= target) {
            return None;
        }
        Some(done.clamp(*PASS.start(), *PASS.end()).min(spp - done))
    }

    /// Sorting key, the most urgent crop first: crops with too few samples, then the noisiest.
    fn urgency(&self) -> (u32, f64) {
        (self.reference.samples().min(TRUSTED), -self.noise)
    }
}

/// Runs the command.
pub(super) fn run(args: &ReferenceArgs) -> anyhow::Result<Exit> {
    super::threads::set_threads(args.threads)?;
    let manifest = Manifest::load(&args.manifest).input()?;
    let (scenes, mut work) = open(args, &manifest)?;
    let free = args.spp.is_none() && args.time.is_none();
    let target = args.target_noise.or(free.then_some(TARGET)).unwrap_or(0.0);
    let spp = args.spp.unwrap_or(1 << 24);
    let (clock, stop) = (Instant::now(), Stop::listen());
    stop.begin();
    let mut exit = Exit::Done;
    loop {
        if stop.asked() {
            exit = Exit::Stopped;
            break;
        }
        let left = work
            .iter_mut()
            .filter(|w| w.pass(spp, target.into()).is_some());
        let next = left.min_by(|a, b| {
            let (a, b) = (a.urgency(), b.urgency());
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        let (Some(next), false) = (next, args.time.is_some_and(|t| clock.elapsed() >= t)) else {
            break;
        };
        let Some(samples) = next.pass(spp, target.into()) else {
            break;
        };
        let scene = &scenes[next.scene];
        let camera = &scene.parts().cameras[next.entry.camera];
        next.reference.extend(scene, camera, samples);
        next.reference.save().output()?;
        next.noise = next.reference.noise().mean;
        if std::io::stderr().is_terminal() {
            note(line(next));
        } else {
            tracing::info!("{}", line(next));
        }
    }
    let head = "crop                             spp    noise  median     p90".to_owned();
    let lines: Vec<String> = [head].into_iter().chain(work.iter().map(line)).collect();
    print(lines.join("\n") + "\n")?;
    Ok(exit)
}

fn line(work: &Work) -> String {
    let noise = work.reference.noise();
    format!(
        "{:28} {:7}  {:.4}  {:.4}  {:.4}",
        work.label(),
        work.reference.samples(),
        noise.mean,
        noise.median,
        noise.p90
    )
}

/// The selected scenes, and their crops with the references so far.
fn open<'a>(
    args: &ReferenceArgs,
    manifest: &'a Manifest,
) -> anyhow::Result<(Vec<Scene>, Vec<Work<'a>>)> {
    let input = |message: String| -> anyhow::Error {
        Failure(
            Exit::Input,
            anyhow!("{}: {message}", args.manifest.display()),
        )
        .into()
    };
    if let Some(name) =
        (args.scenes.iter()).find(|name| manifest.scenes.iter().all(|e| e.name != **name))
    {
        return Err(input(format!("no scene `{name}`")));
    }
    let wanted = |e: &&SceneEntry| args.scenes.is_empty() || args.scenes.contains(&e.name);
    let (mut scenes, mut work) = (Vec::new(), Vec::new());
    for entry in manifest.scenes.iter().filter(wanted) {
        let loaded = load(&manifest.file(entry), &LoadOptions::default()).input()?;
        if entry.camera >= loaded.parts.cameras.len() {
            return Err(input(format!(
                "{} has no camera {}",
                entry.name, entry.camera
            )));
        }
        for &crop in &entry.crops {
            let reference =
                Reference::open(manifest, entry, crop, &loaded.digest, args.seed).input()?;
            let noise = reference.noise().mean;
            work.push(Work {
                entry,
                crop,
                scene: scenes.len(),
                reference,
                noise,
            });
        }
        scenes.push(Scene::new(loaded.parts));
    }
    Ok((scenes, work))
}
