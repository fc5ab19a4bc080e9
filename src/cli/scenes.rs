//! `opsr scenes`: the training scenes that the program carries as code.

use super::Blame;
use opsr::scene::builtin::training;
use std::path::PathBuf;

/// Options of `opsr scenes`.
#[derive(Debug, clap::Args)]
pub(super) struct ScenesArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum Action {
    /// Write the training and validation scenes and their manifest into a folder.
    Write {
        /// The folder; made if it is not there, files of the same names are replaced.
        #[arg(default_value = "training_scenes")]
        dir: PathBuf,
    },
}

/// Runs the command.
pub(super) fn run(args: &ScenesArgs) -> anyhow::Result<()> {
    let Action::Write { dir } = &args.action;
    for path in training::write(dir).output()? {
        println!("{}", path.display());
    }
    Ok(())
}
