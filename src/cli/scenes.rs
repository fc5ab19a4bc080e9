//! `opsr scenes`: the training scenes that the program contains as code.

use super::exit::{Blame, Exit};
use super::output::print;
use super::references::{self, ReferenceArgs};
use opsr::gallery::training;
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
        /// The folder; created if it does not exist, files of the same names are replaced.
        #[arg(long, value_name = "DIR", default_value = "training_scenes")]
        out: PathBuf,
    },
    /// Render the references of a manifest's crops by plain path tracing, the noisiest crop first.
    ///
    /// Files are replaced after every pass; a later run resumes from them.
    Reference(ReferenceArgs),
}

/// Runs the command.
pub(super) fn run(args: &ScenesArgs) -> anyhow::Result<Exit> {
    match &args.action {
        Action::Write { out } => {
            for path in training::write(out).output()? {
                print(format!("{}\n", path.display()))?;
            }
            Ok(Exit::Done)
        }
        Action::Reference(args) => references::run(args),
    }
}
