//! `opsr resolve`: repeats the choice among levels from a checkpoint.

use super::exit::{Blame, IntoExit};
use super::options::FileOptions;
use crate::outputs::Outputs;
use crate::outputs::check_layers;
use anyhow::anyhow;
use opsr::integrator::checkpoint::Checkpoint;
use opsr::render::Outcome;
use std::path::PathBuf;

/// Options of `opsr resolve`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Checkpoint of a render of several levels (`opsr render --checkpoint`).
    #[arg(value_name = "FILE")]
    film: PathBuf,
    /// File of the picture: .exr or .png; may be given several times.
    #[arg(short, long, value_name = "FILE", default_value = "out.exr")]
    output: Vec<PathBuf>,
    #[command(flatten)]
    files: FileOptions,
}

/// Runs the command.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let spec = &args.files.0;
    let outputs = Outputs::new(&args.output).into_exit()?;
    let denoiser = spec.denoiser().into_exit()?;
    check_layers(spec, &args.output).into_exit()?;
    let film = Checkpoint::open(&args.film).input()?;
    let path = args.film.display();
    let version = env!("CARGO_PKG_VERSION");
    if film.fingerprint.version != version {
        let theirs = &film.fingerprint.version;
        let what = anyhow!("{path}: a film of version {theirs}; this is version {version}");
        return Err(what).input();
    }
    if film.picture.levels.is_none() {
        let what = anyhow!("{path}: a film of one level, there is nothing to choose");
        return Err(what).input();
    }
    let outcome = Outcome::of_film(spec, film.picture, &[], film.metadata, None).into_exit()?;
    let finished = outcome.finish_files(denoiser.as_ref()).into_exit()?;
    outputs.write(&finished).into_exit()?;
    Ok(())
}
