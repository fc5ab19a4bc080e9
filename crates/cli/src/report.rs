//! `opsr report`: the results of a bench as a page.

use std::path::PathBuf;

use clap::Args;

use opsr::files;
use opsr::render::can_write;
use opsr_lab::report::bench::page::{overalls, page, plots};
use opsr_lab::report::bench::{Results, summary};

use super::exit::{Blame, IntoExit};

/// Options of `opsr report`.
#[derive(Args, Debug)]
pub(super) struct ReportArgs {
    /// Results of `opsr bench` (.json).
    results: PathBuf,
    /// The page: one self-contained file.
    #[arg(short, long, value_name = "FILE", default_value = "report.html")]
    output: PathBuf,
    /// Also write the plots as files (.svg) to this folder.
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

/// Runs the command.
pub(super) fn run(args: &ReportArgs) -> anyhow::Result<()> {
    let results = Results::load(&args.results).input()?;
    let html = page(&results);
    // The page is written last, after all files that belong to it.
    can_write(&args.output).into_exit()?;
    if let Some(folder) = &args.plots {
        files::create_folder(folder).output()?;
        if let Some(plot) = overalls(&results).first().and_then(plots::standings) {
            files::write_bytes(&folder.join("overall.svg"), plot).output()?;
        }
        for scene in summary::summaries(&results) {
            for (i, (plot, _)) in plots::curves(&results, &scene).iter().enumerate() {
                let name = format!("{}-{}.svg", file_name(&scene.name), i + 1);
                files::write_bytes(&folder.join(name), plot).output()?;
            }
        }
    }
    files::write_bytes(&args.output, html).output()
}

/// The name of a scene with only letters, digits, and `._-`.
fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "._-".contains(c) {
            c
        } else {
            '-'
        }
    };
    name.chars().map(plain).collect()
}
