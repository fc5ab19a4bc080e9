//! The `opsr` program: options become calls of the libraries, and errors become messages and exit codes in one place.
//!
//! Only this crate uses anyhow and the terminal. Types that are options derive clap's traits where they are defined.

// These macros panic if the output is closed; output::print and output::note do not.
#![deny(clippy::print_stderr, clippy::print_stdout)]

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use exit::{Exit, Failure};
use opsr::render::{Fault, Names, renamed};
use output::note;
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::{fmt, prelude::*};

mod bar;
mod bench;
mod compare;
mod convert;
mod ended;
mod error_log;
mod exit;
mod expected;
mod film;
mod info;
mod listener;
mod options;
mod output;
mod outputs;
mod pace;
mod part;
mod references;
mod render;
mod render_args;
mod report;
mod resolve;
mod scenes;
mod shell;
mod stop;
mod table;
mod threads;
mod trace;
#[cfg(feature = "train")]
mod train;
mod verify;
mod view;

/// Render caustics, glossy chains and light seen through glass with learned path space regularisation.
#[derive(Parser)]
#[command(name = "opsr", version, max_term_width = 100, after_help = EXIT_CODES)]
struct Args {
    /// Log more (-v, -vv); RUST_LOG is honoured too.
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done; 1 failed; 2 wrong usage; 3 an input file is missing, damaged or not \
supported; 4 a result could not be written; 5 stopped by the user or within the first sample, the \
results so far are saved; 6 pictures differ by more \
than the options of `opsr compare` allow; 7 not enough memory, which is checked before it is allocated.";

#[derive(Subcommand)]
enum Command {
    /// Render a scene: glTF, pbrt, Mitsuba, OBJ or PLY.
    Render(Box<render_args::RenderArgs>),
    /// Render a part of a picture, for `opsr merge`.
    Part(Box<part::PartArgs>),
    /// Merge the parts of a render.
    Merge(Box<part::MergeArgs>),
    /// Average the frames of an animation along their surfaces.
    Film(Box<film::FilmArgs>),
    /// Print the paths of a pixel.
    Trace(Box<trace::TraceArgs>),
    /// Render a scene interactively in the browser.
    View(Box<view::ViewArgs>),
    /// Learn tables of attenuation factors.
    #[cfg(feature = "train")]
    Train(Box<train::TrainArgs>),
    /// Trace the paths for a training in advance, for instance on several machines.
    #[cfg(feature = "train")]
    Record(Box<train::record::RecordArgs>),
    /// Describe a scene: geometry, materials, lights, cameras, warnings.
    Info(Box<info::InfoArgs>),
    /// Write a scene as one binary glTF file.
    Convert(Box<convert::Args>),
    /// Compare pictures with a reference.
    Compare(Box<compare::CompareArgs>),
    /// Write built-in scenes, and render references of the training scenes.
    Scenes(scenes::ScenesArgs),
    /// Compare methods on scenes with references.
    Bench(bench::BenchArgs),
    /// Show a table of attenuation factors, or write it for another renderer.
    Table(table::TableArgs),
    /// Choose among the levels of a render again, from its checkpoint.
    Resolve(Box<resolve::Args>),
    /// Turn the results of a bench into one HTML file.
    Report(report::ReportArgs),
    /// Run hard numerical cases on this machine.
    Verify(verify::VerifyArgs),
    /// Print completions of options for a shell.
    Completions(shell::CompletionsArgs),
    /// Write manual pages.
    Man(shell::ManArgs),
}

/// Lets every option accept a negative number as its value, so that the option's own message explains the error instead
/// of clap's "unknown option".
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let values = |arg: clap::Arg| {
        let is_option = arg.get_action().takes_values() && !arg.is_positional();
        let has_hyphens = arg.is_allow_hyphen_values_set();
        arg.allow_negative_numbers(is_option && !has_hyphens)
    };
    command
        .mut_args(values)
        .mut_subcommands(with_negative_numbers)
}

/// Options that were renamed or became commands.
const MOVED: [(&str, &str); 5] = [
    ("log", "`--stats FILE.csv`"),
    ("film", "`opsr part`, with -o for its file"),
    ("samples", "an option of `opsr part`"),
    ("trace-pixel", "`opsr trace SCENE X,Y`"),
    ("sample", "an option of `opsr trace`"),
];

/// Adds the new name to an error about a renamed option.
fn with_new_name(error: clap::Error) -> clap::Error {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let unknown = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(flag)) if error.kind() == ErrorKind::UnknownArgument => flag,
        _ => return error,
    };
    let name = unknown.trim_start_matches('-');
    let command = MOVED.iter().find(|(old, _)| *old == name);
    let option = || renamed(name).map(|new| Fault::usage(new).message(Names::Flags));
    match command.map(|(_, new)| (*new).to_owned()).or_else(option) {
        Some(new) => {
            let what = format!("{unknown} is {new} now\n");
            clap::Error::raw(ErrorKind::UnknownArgument, what)
        }
        None => error,
    }
}

/// Makes glibc keep up to 62 MB of freed memory per thread for the next tile of a picture. glibc derives its limits
/// from the largest freed block, and starts at 128 kB. Other allocators are not affected.
fn keep_freed_memory() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(31 << 20)));
}

fn main() -> ExitCode {
    keep_freed_memory();
    let command = with_negative_numbers(Args::command());
    let matches = command.try_get_matches();
    let matches = matches.unwrap_or_else(|e| with_new_name(e).exit());
    let args = Args::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    let levels = [LevelFilter::WARN, LevelFilter::INFO, LevelFilter::DEBUG];
    let level = levels[usize::from(args.verbose.min(2))];
    let wished: Option<Targets> = std::env::var("RUST_LOG").ok().and_then(|w| w.parse().ok());
    let filter = wished.unwrap_or(Targets::new().with_default(level));
    let lines = fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        // By default a line that cannot be written is reported to the same stream, which would panic.
        .log_internal_errors(false)
        .with_target(false)
        .without_time();
    tracing_subscriber::registry()
        .with(lines.with_filter(filter))
        .init();
    let result = match args.command {
        Command::Render(args) => render::run(&args),
        Command::Part(args) => part::render(&args),
        Command::Film(args) => film::run(&args).map(|()| Exit::Done),
        Command::Trace(args) => trace::run(&args).map(|()| Exit::Done),
        Command::View(args) => view::run(&args),
        #[cfg(feature = "train")]
        Command::Train(args) => train::run(&args),
        #[cfg(feature = "train")]
        Command::Record(args) => train::record::run(&args),
        Command::Info(args) => info::run(&args).map(|()| Exit::Done),
        Command::Compare(args) => compare::run(&args),
        Command::Scenes(args) => scenes::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Table(args) => table::run(&args).map(|()| Exit::Done),
        Command::Convert(args) => convert::run(&args).map(|()| Exit::Done),
        Command::Resolve(args) => resolve::run(&args).map(|()| Exit::Done),
        Command::Merge(args) => part::run(&args).map(|()| Exit::Done),
        Command::Report(args) => report::run(&args).map(|()| Exit::Done),
        Command::Verify(args) => verify::run(&args),
        Command::Completions(args) => shell::completions(&args).map(|()| Exit::Done),
        Command::Man(args) => shell::man(&args).map(|()| Exit::Done),
    };
    let exit = result.unwrap_or_else(|error| {
        note(format_args!("opsr: {error:#}"));
        error
            .downcast_ref::<Failure>()
            .map_or(Exit::Failed, |failure| failure.0)
    });
    ExitCode::from(exit as u8)
}
