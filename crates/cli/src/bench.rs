//! `opsr bench`: methods against each other, measured.

use std::path::PathBuf;

use clap::Args;
use opsr_lab::report::bench::{Outcome, Status, Suite, run as measure, summary};

use super::bar::terminal;
use super::exit::{Blame, Exit};
use super::output::{command, print};
use super::stop::Stop;

const EXAMPLE: &str = "\
A suite:
  baseline = \"plain\"        # by default the first method
  seeds = 5                 # with fewer there is no verdict
  times = [0.5, 1, 2, 4]    # seconds after which errors are recorded
  samples = [4, 16]         # and samples per pixel
  clock = \"cpu\"             # CPU time over threads, for machines with other work; or \"wall\"
  [[scene]]
  name = \"box\"
  file = \"box.glb\"          # or builtin = \"caustic-box\"
  size = [256, 256]
  reference_spp = 65536     # or reference = \"box.exr\"
  # crop = [x, y, w, h], inset = [x, y, w, h], camera, max_vertices, exposure, group, methods = [names],
  # distribution, environment = \"sky.hdr\", reference_integrator = \"bdpt\"
  [[method]]
  name = \"learned\"
  table = \"beta-0.001\"      # or 0.1; other options of a render have their names, with underscores:
                            # mode, levels, resolve, integrator, denoise and so on; without any, plain path tracing
  # integrator = \"vcm\"      # and details such as radius = 0.1: see the integrators and keys of `opsr render --help`";

/// Options of `opsr bench`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLE)]
pub(super) struct BenchArgs {
    /// The suite: scenes, methods, seeds, time points (.toml).
    suite: PathBuf,
    /// File of the results (.json). Measurements that it already holds are not repeated.
    #[arg(short, long, value_name = "FILE", default_value = "results.json")]
    output: PathBuf,
    /// Number of threads; by default the number of cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

/// Runs the command: a table per scene goes to standard output.
pub(super) fn run(args: &BenchArgs) -> anyhow::Result<Exit> {
    let suite = Suite::load(&args.suite).input()?;
    super::threads::set_threads(args.threads)?;
    let command = command();
    let stop = Stop::listen();
    stop.begin();
    let bar = terminal(0, "{bar:30} {pos}/{len} {msg}");
    let mut listener = |status: &Status| {
        bar.set_length(status.total as u64);
        bar.set_position(status.done as u64);
        bar.set_message(status.what.clone());
        stop.flow()
    };
    let measured = measure(&suite, &args.output, &command, &mut listener);
    bar.finish_and_clear();
    let (results, outcome) = match measured {
        Err(error) if error.is_output() => Err(error).output()?,
        other => other.input()?,
    };
    print(summary::text(&results))?;
    Ok(match outcome {
        Outcome::Done => Exit::Done,
        Outcome::Stopped => Exit::Stopped,
    })
}
