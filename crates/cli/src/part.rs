//! `opsr part` and `opsr merge`: a render made in parts.

use super::bar::Bar;
use super::ended::average_error;
use super::exit::{Blame, Exit, IntoExit};
use super::options::{CropOption, FileOptions, MORE, PartOptions, samples};
use super::output::note;
use super::render::{open, remark_choice, request, spec_files};
use super::render_args::ProgramArgs;
use super::stop::Stop;
use super::threads::set_threads;
use crate::outputs::{Outputs, check_distinct, check_layers};
use anyhow::anyhow;
use opsr::image::film::Window;
use opsr::integrator::drive::RenderProgress;
use opsr::integrator::part::{MergeError, Merged, merge};
use opsr::render::can_write;
use opsr::render::{Fault, Outcome, Request, Spec};
use std::ops::{ControlFlow, Range};
use std::path::PathBuf;

/// Options of `opsr part`.
#[derive(Debug, clap::Args)]
#[command(after_help = MORE, after_long_help = EXAMPLES)]
pub(super) struct PartArgs {
    /// The scene: glTF 2.0 (.gltf or .glb), pbrt-v4 (.pbrt), Mitsuba (.xml), OBJ or PLY.
    scene: PathBuf,
    /// File of the part. It is either complete or absent.
    #[arg(short, long, value_name = "FILE", required = true)]
    output: PathBuf,
    /// Samples of the whole picture that this part renders.
    ///
    /// From sample A (counted from 0) up to but not including B. --spp gives the number of samples of the whole
    /// picture, on which the choice of the integrator depends. Split the samples, the picture by --crop, or both. A
    /// part that begins after sample 0 stores every sample: 12 bytes per pixel and sample, with levels 56 more and 12 for
    /// each level. Other parts store only sums, so parts of all samples of a crop are small.
    #[arg(long, value_name = "A..B", value_parser = samples)]
    samples: Option<Range<u32>>,
    #[command(flatten)]
    render: PartOptions,
    #[command(flatten)]
    program: ProgramArgs,
}

impl PartArgs {
    /// The options of the command line, checked.
    fn spec(&self) -> Result<Spec, Fault> {
        let spec = self.render.0.clone();
        spec.check()?;
        if let (Some(samples), Some(spp)) = (&self.samples, spec.spp)
            && samples.end > spp
        {
            let what = format!("--samples: the whole picture has {spp} samples, by --spp");
            return Err(Fault::usage(what));
        }
        Request::check_part(&spec)?;
        Ok(spec)
    }

    fn check_file(&self, spec: &Spec, read: &[PathBuf]) -> anyhow::Result<()> {
        let inputs = read.iter().chain([&self.scene]).map(PathBuf::as_path);
        check_distinct([self.output.as_path()], inputs.chain(spec_files(spec))).into_exit()
    }
}

/// Runs `opsr part`.
pub(super) fn render(args: &PartArgs) -> anyhow::Result<Exit> {
    let mut spec = args.spec().into_exit()?;
    can_write(&args.output).into_exit()?;
    args.check_file(&spec, &[])?;
    set_threads(args.program.threads)?;
    let stop = Stop::listen();
    let opened = open(&args.scene, &mut spec)?;
    args.check_file(&spec, &opened.files)?;
    stop.begin();
    let name = args.scene.display().to_string();
    let mut request = request(&spec, &opened, &name)?;
    // A pilot that was stopped gives a part without samples.
    if let ControlFlow::Continue(Some(choice)) = request.choose(&|| !stop.asked()).into_exit()? {
        remark_choice(args.program.progress, &choice);
    }
    let bar = Bar::new(args.program.progress);
    let on_pass = &mut |progress: &RenderProgress| {
        bar.show(progress, None);
        stop.flow()
    };
    let done = request.part(&args.output, args.samples.clone(), None, on_pass);
    bar.finish();
    if done.into_exit()? {
        return Ok(Exit::Done);
    }
    let path = args.output.display();
    note(format_args!(
        "opsr: {path}: not written, the part was stopped"
    ));
    Ok(Exit::Stopped)
}

/// Options of `opsr merge`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct MergeArgs {
    /// Parts of one render (`opsr part`), in any order.
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
    /// File of the picture: .exr or .png; may be given several times. It equals that of a single render with
    /// --reproducible, byte for byte, except for light that only the witness of a single render finds.
    #[arg(short, long, value_name = "FILE", default_value = "out.exr")]
    output: Vec<PathBuf>,
    /// Samples per pixel of the complete picture; by default the most that a pixel has.
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
    check_layers(spec, &args.output).into_exit()?;
    let window = |size| (args.crop.0.crop).map_or(Window::full(size), |crop| crop.of(size));
    let merged = merge(&args.parts, window, args.spp, true).map_err(|error| match error {
        // The usual exit codes of these causes.
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
    let wanted = first.layers.iter().map(|name| name.parse());
    let wanted = wanted.collect::<Result<Vec<_>, _>>();
    let wanted = wanted.map_err(anyhow::Error::msg).input()?;
    let camera = Some(first.camera);
    let outcome = Outcome::of_film(spec, picture, &wanted, metadata, camera).into_exit()?;
    let finished = outcome.finish_files(denoiser.as_ref()).into_exit()?;
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
  opsr part scene.glb --spp 1024 --crop 0,0,1/2,100% -o left.part
  opsr part scene.glb --spp 1024 --crop 1/2,0,1/2,100% -o right.part
  opsr merge left.part right.part -o out.exr";
