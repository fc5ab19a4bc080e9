//! `opsr render --film` and `opsr merge`: a render made in parts.

use super::bar::Bar;
use super::ended::average_error;
use super::exit::{Blame, Exit, IntoExit};
use super::options::{CropOption, FileOptions};
use super::output::note;
use super::render::remark_choice;
use super::render_args::RenderArgs;
use super::stop::Stop;
use anyhow::anyhow;
use opsr::image::film::Window;
use opsr::integrator::drive::RenderProgress;
use opsr::integrator::layers::Aov;
use opsr::integrator::part::{MergeError, Merged, merge};
use opsr::render::files::Outputs;
use opsr::render::{Outcome, Request};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Renders a part into a file.
pub(super) fn render(
    args: &RenderArgs,
    request: &mut Request<'_>,
    path: &Path,
    stop: &Stop,
) -> anyhow::Result<Exit> {
    // A pilot that is stopped leaves a part of no samples.
    if let ControlFlow::Continue(Some(choice)) = request.choose(&|| !stop.asked()).into_exit()? {
        remark_choice(args, &choice);
    }
    let samples = args.samples.clone().unwrap_or(request.all_samples());
    let bar = Bar::new(args.progress);
    let on_pass = &mut |progress: &RenderProgress| {
        bar.show(progress, None);
        stop.flow()
    };
    let done = request.part(path, samples, None, on_pass);
    bar.finish();
    if done.into_exit()? {
        return Ok(Exit::Done);
    }
    let path = path.display();
    note(format_args!(
        "opsr: {path}: not written, the part was stopped"
    ));
    Ok(Exit::Stopped)
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
    #[command(flatten)]
    crop: CropOption,
    #[command(flatten)]
    files: FileOptions,
}

/// Runs `opsr merge`.
pub(super) fn run(args: &MergeArgs) -> anyhow::Result<()> {
    let spec = &args.files.0;
    let outputs = Outputs::new(&args.output).into_exit()?;
    let denoiser = spec.denoiser().into_exit()?;
    spec.check_layers(&args.output).into_exit()?;
    let window = |size| (args.crop.0.crop).map_or(Window::full(size), |crop| crop.of(size));
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
    let refused = picture.film.rejected.total();
    metadata.insert("spp".into(), samples.to_string());
    metadata.insert("refused_samples".into(), refused.to_string());
    let wanted = first.layers.iter().map(|name| Aov::named(name));
    let wanted = wanted.collect::<Result<Vec<_>, _>>();
    let wanted = wanted.map_err(anyhow::Error::msg).input()?;
    let camera = Some(first.camera);
    let outcome = Outcome::of_film(spec, picture, &wanted, metadata, camera).into_exit()?;
    let finished = outcome.finish(denoiser.as_ref()).into_exit()?;
    outputs.write(&finished).into_exit()?;
    let Window { w, h, .. } = finished.outcome.picture.film.window;
    let (names, parts) = (outputs.names(), args.parts.len());
    let error = average_error(&finished.statement());
    note(format_args!(
        "{names}: {w}x{h}, {samples} spp from {parts} parts{error}"
    ));
    if refused > 0 {
        tracing::warn!("{refused} samples were refused");
    }
    Ok(())
}

const EXAMPLES: &str = "Examples:
  opsr render scene.glb --spp 1024 --crop 0,0,1/2,100% --film left.part
  opsr render scene.glb --spp 1024 --crop 1/2,0,1/2,100% --film right.part
  opsr merge left.part right.part -o out.exr";
