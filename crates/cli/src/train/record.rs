//! `opsr record`: traces the paths of a training in advance, in any number of processes.

use super::super::bar::Style;
use super::super::exit::{Blame, Exit};
use super::super::options::range;
use super::super::stop::Stop;
use super::super::threads::set_threads;
use super::blame;
use super::display::ProgressDisplay;
use super::settings::SettingArgs;
use anyhow::anyhow;
use clap::Args;
use opsr::files;
use opsr_train::learn::recordings::recordings_in;
use opsr_train::record::crop::DatasetError;
use opsr_train::{RecordingControl, Recordings, TrainError};
use std::ops::Range;
use std::path::PathBuf;

/// Options of `opsr record`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct RecordArgs {
    /// Folder of the recordings, one file for each crop. Complete recordings that exist are kept.
    #[arg(long, value_name = "DIR")]
    recordings: PathBuf,
    /// Crops to record, from A (counted from 0) up to but not including B; by default all.
    #[arg(long, value_name = "A..B", value_parser = crops)]
    crops: Option<Range<u32>>,
    #[command(flatten)]
    settings: SettingArgs,
    /// Number of threads; all cores by default. The recordings do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Display of progress.
    #[arg(long, value_enum, default_value_t)]
    progress: Style,
}

const EXAMPLES: &str = "\
Examples:
  opsr record --recordings shared/paths --crops 0..6     on one machine
  opsr record --recordings shared/paths --crops 6..12    on another
  opsr train --recordings shared/paths --out mine        the same tables as without recordings

The settings are those of `opsr train`; beta, optimiser, model and steps do not change a recording.";

/// Crops such as `3..6`.
fn crops(text: &str) -> Result<Range<u32>, String> {
    range(text)
        .ok_or("expected A..B, such as 0..4: the crops from number A on (from 0), without B".into())
}

/// Runs the command.
pub(crate) fn run(args: &RecordArgs) -> anyhow::Result<Exit> {
    let config = args.settings.resolve()?;
    let stop = Stop::listen();
    set_threads(args.threads)?;
    let recordings = Recordings::open(config).map_err(blame)?;
    let names = recordings.names();
    let all = 0..names.len();
    let numbers = match &args.crops {
        Some(crops) => crops.start as usize..crops.end as usize,
        None => all.clone(),
    };
    if numbers.end > all.end {
        let what = anyhow!("--crops {numbers:?}: there are {all:?}");
        return Err(what).usage();
    }
    let folder = &args.recordings;
    files::create_folder(folder).output()?;
    let progress = ProgressDisplay::new(args.progress, 0);
    let control = RecordingControl {
        folder: Some(folder.clone()),
        stop: stop.flag(),
        listen: &|state| {
            stop.begin();
            progress.recording(state);
        },
        ..RecordingControl::default()
    };
    let done = recordings.record(numbers, &control);
    let exit = match done {
        Err(TrainError::Dataset(DatasetError::Stopped)) => Exit::Stopped,
        done => done.map(|()| Exit::Done).map_err(blame)?,
    };
    let there = recordings_in(folder);
    let there = names
        .iter()
        .filter(|name| there.iter().any(|path| path.ends_with(name)));
    let (there, all, folder) = (there.count(), all.end, folder.display());
    progress.say(&format!("{folder}: recordings of {there} of {all} crops"));
    Ok(exit)
}
