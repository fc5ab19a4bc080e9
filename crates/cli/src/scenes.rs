//! `opsr scenes`: the scenes that the program contains as code.

use super::exit::{Blame, Exit};
use super::output::print;
use super::references::{self, ReferenceArgs};
use anyhow::Context as _;
use clap::builder::PossibleValuesParser;
use opsr_lab::gallery::{self, training};
use std::path::PathBuf;

/// Options of `opsr scenes`.
#[derive(Debug, clap::Args)]
pub(super) struct ScenesArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum Action {
    /// Write the training and validation scenes and their manifest, or the named scenes, into a folder.
    Write {
        /// Scenes to write instead, without a manifest; a scene with a sky cannot be written.
        #[arg(value_name = "NAME", value_parser = PossibleValuesParser::new(gallery::names()))]
        names: Vec<String>,
        /// The folder. It is created if it does not exist; files of the same names are replaced.
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
        Action::Write { names, out } => {
            let written = if names.is_empty() {
                training::write(out).output()?
            } else {
                let one =
                    |name: &String| gallery::write([name.as_str()], out).context(name.clone());
                let files: anyhow::Result<Vec<_>> = names.iter().map(one).collect();
                files.output()?.concat()
            };
            for path in written {
                print(format!("{}\n", path.display()))?;
            }
            Ok(Exit::Done)
        }
        Action::Reference(args) => references::run(args),
    }
}
