//! `opsr resolve`: the choice among levels, made again from a checkpoint.

use super::exit::{Blame, Told};
use super::options::FileOptions;
use anyhow::anyhow;
use opsr::integrator::checkpoint::Checkpoint;
use opsr::integrator::method::IntegratorKind;
use opsr::render::OPTIONS;
use opsr::render::files::Outputs;
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
    let outputs = Outputs::new(&args.output, spec).told()?;
    spec.check_layers(&args.output).told()?;
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
    // The choice is made anew, everything else is the render's.
    let mut metadata = film.metadata;
    for option in OPTIONS.iter().filter(|option| option.of_film) {
        metadata.remove(option.name);
    }
    let chosen = spec.recorded(IntegratorKind::Path);
    metadata.extend(chosen.map(|(key, value)| (key.to_owned(), value)));
    outputs
        .write(&film.picture, Vec::new(), None, &metadata)
        .told()?;
    Ok(())
}
