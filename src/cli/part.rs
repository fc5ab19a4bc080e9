//! `opsr render --film` and `opsr merge`: a render made in parts.

use super::aovs;
use super::bar::Bar;
use super::output::{FileArgs, Outputs, ResolveArgs};
use super::render::{DEFAULT_SPP, RenderJob, check_memory};
use super::render_args::RenderArgs;
use super::{Blame, Exit, job};
use anyhow::anyhow;
use opsr::image::film::{Film, Window};
use opsr::integrator::View;
use opsr::integrator::drive::RenderProgress;
use opsr::integrator::layers::{Aov, Layers};
use opsr::integrator::method::IntegratorKind;
use opsr::integrator::part::{MergeError, Merged, Part, merge};
use opsr::math::UVec2;
use opsr::scene::Camera;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A range of numbers such as `64..128`.
pub(super) fn range(text: &str) -> Option<Range<u32>> {
    let (a, b) = text.split_once("..")?;
    let range = a.parse().ok()?..b.parse().ok()?;
    (!range.is_empty()).then_some(range)
}

/// Samples such as `64..128`.
pub(super) fn samples(text: &str) -> Result<Range<u32>, String> {
    let what = "expected A..B, such as 64..128: the samples from number A on (from 0), without B";
    range(text).ok_or(what.into())
}

/// An error for a layer that a part cannot keep.
pub(super) fn check(args: &RenderArgs) -> anyhow::Result<()> {
    let wants = |aov| args.aov.contains(&aov);
    let what = if wants(Aov::Position) || wants(Aov::Id) || wants(Aov::Time) {
        "--film keeps no --aov position, id and time"
    } else if args.method.guide.is_some() {
        "--film is without --guide: a guide learns from all samples before"
    } else if args.method.integrator == IntegratorKind::Auto {
        "--integrator auto chooses by a pilot, for each --film anew: name one"
    } else {
        return Ok(());
    };
    Err(anyhow!(what)).usage()
}

impl RenderJob<'_> {
    /// Renders a part into a file.
    pub(super) fn part(&self, path: &Path, camera: &Camera, size: UVec2) -> anyhow::Result<Exit> {
        let args = self.args;
        let window = job::window(args, size);
        Film::check(size, window)
            .map_err(|e| anyhow!("{}: {e}", job::window_option(args)))
            .usage()?;
        check_memory(args, &self.settings, size, window)?;
        let samples = args.samples.clone();
        let samples = samples.unwrap_or(0..args.spp.unwrap_or(DEFAULT_SPP));
        let view = View::new(&self.opened.scene, camera, size, window);
        let [first, light, _] = aovs::recorded(args);
        let (fingerprint, levels) = (self.fingerprint(size, None), self.settings.levels.clone());
        let mut part = Part::new(fingerprint, &view, samples, levels, [first, light]);
        part.layers = args.aov.iter().map(|aov| aov.name()).collect();
        part.metadata = self.provenance.reproducible_metadata(0, 0);
        let bar = Bar::new(args.progress);
        let done = part.render(
            path,
            &mut *self.settings.integrator(),
            &view,
            &mut |progress: &RenderProgress| {
                bar.show(progress, None);
                self.stop.flow()
            },
        );
        bar.finish();
        match done.output()? {
            true => Ok(Exit::Done),
            false => {
                eprintln!(
                    "opsr: {}: not written, the part was stopped",
                    path.display()
                );
                Ok(Exit::Stopped)
            }
        }
    }
}

/// Options of `opsr merge`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct MergeArgs {
    /// Parts of one render (`opsr render --film`), in any order.
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
    /// File of the picture: .exr or .png; may be given several times. It has the bytes of the single render with
    /// --reproducible.
    #[arg(short, long, value_name = "FILE", default_value = "out.exr")]
    output: Vec<PathBuf>,
    /// Samples per pixel that the parts shall make; without it the most that a pixel has.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Pixels that the parts shall make, as of `opsr render`; without it the whole frame.
    #[arg(long, value_name = "X,Y,W,H", value_parser = job::crop)]
    crop: Option<job::Crop>,
    #[command(flatten)]
    resolve: ResolveArgs,
    #[command(flatten)]
    files: FileArgs,
}

/// Runs `opsr merge`.
pub(super) fn run(args: &MergeArgs) -> anyhow::Result<()> {
    let outputs = Outputs::new(&args.output, args.files, args.resolve)?;
    let window = |size| (args.crop).map_or(Window::full(size), |crop| crop.of(size));
    let merged = merge(&args.parts, window, args.spp).map_err(|error| match error {
        // With the exit codes that they have elsewhere.
        MergeError::File(error) => anyhow::Error::from(error),
        MergeError::Memory(shortage) => shortage.into(),
        MergeError::Samples(what) => anyhow!(what),
    });
    let Merged {
        first,
        samples,
        picture,
    } = merged.input()?;
    let mut metadata = first.metadata;
    metadata.insert("spp".into(), samples.to_string());
    let refused = picture.film.rejected.total();
    metadata.insert("refused_samples".into(), refused.to_string());
    let wanted = first.layers.iter().map(|name| Aov::named(name));
    let wanted = wanted.collect::<Result<Vec<_>, _>>();
    let wanted = wanted.map_err(anyhow::Error::msg).input()?;
    let layers = Layers::recorded(&wanted).of(&picture);
    let written = outputs.write(&picture, layers, Some(first.camera), &metadata)?;
    let Window { w, h, .. } = picture.film.window;
    let (names, parts) = (outputs.names(), args.parts.len());
    let error = match written.error {
        error if error.is_finite() => format!(", estimated relative error {error:.4}"),
        _ => String::new(),
    };
    eprintln!("{names}: {w}x{h}, {samples} spp from {parts} parts{error}");
    if refused > 0 {
        tracing::warn!("{refused} samples were refused");
    }
    Ok(())
}

const EXAMPLES: &str = "Examples:
  opsr render scene.glb --spp 1024 --crop 0,0,1/2,100% --film left.part
  opsr render scene.glb --spp 1024 --crop 1/2,0,1/2,100% --film right.part
  opsr merge left.part right.part -o out.exr";
