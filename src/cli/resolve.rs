//! `opsr resolve`: the choice among levels, made again from a checkpoint.

use super::Blame;
use super::output::{FileArgs, Outputs, ResolveArgs};
use anyhow::anyhow;
use opsr::image::exr::Metadata;
use opsr::integrator::checkpoint::Checkpoint;
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
    resolve: ResolveArgs,
    #[command(flatten)]
    files: FileArgs,
}

/// Runs the command.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let outputs = Outputs::new(&args.output, args.files, args.resolve)?;
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
    let metadata = [
        ("version", version.to_owned()),
        ("scene_sha256", film.fingerprint.scene),
        ("spp", film.samples.to_string()),
        ("levels", format!("{:?}", film.levels)),
    ];
    let metadata: Metadata = metadata.map(|(key, value)| (key.to_owned(), value)).into();
    outputs.write(&film.picture, Vec::new(), None, &metadata)?;
    Ok(())
}
