//! `opsr train`: learns tables of attenuation factors from scenes.

mod display;
mod log;
pub(super) mod record;
mod settings;

use super::bar::Style;
use super::exit::{Blame, Exit, of_memory};
use super::stop::Stop;
use anyhow::anyhow;
use clap::Args;
use display::ProgressDisplay;
use log::MetricsLog;
use opsr::files::{self, Claim};
use opsr::regularise::file::{TableFile, save as save_table_file};
use opsr::regularise::{AttenuationTable, Lookup};
use opsr_lab::report::training::{CropScores, LearnedTable, Report};
use opsr_train::config::{Config, Preset};
use opsr_train::learn::outer_loop::Outcome;
use opsr_train::learn::recordings::recordings_in;
use opsr_train::record::crop::DatasetError;
use opsr_train::record::visits::LIVE_CLASSES;
use opsr_train::{RecordingControl, Session, TrainError, score};
use settings::SettingArgs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `opsr train`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct TrainArgs {
    #[command(flatten)]
    settings: SettingArgs,
    /// Folder of the run, for resolved settings, log, checkpoints, tables and report [default: out/train/PRESET].
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Folder of the finished tables.
    #[arg(long, value_name = "DIR", default_value = "params")]
    out: PathBuf,
    /// Learn only from the recordings in this folder, which `opsr record` made with the same settings; all must be
    /// there.
    #[arg(long, value_name = "DIR")]
    recordings: Option<PathBuf>,
    /// Continue from the recordings and checkpoints in the run's folder.
    #[arg(long)]
    resume: bool,
    /// Replace existing tables and an existing run; otherwise the program ends with exit code 2.
    #[arg(long)]
    force: bool,
    /// Number of threads; all cores by default. The tables do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Display of progress.
    #[arg(long, value_enum, default_value_t)]
    progress: Style,
}

const EXAMPLES: &str = "\
Examples:
  opsr train --beta 0.001,0.05 --out mine  the shipped tables, in mine/: ten thousand steps each from one recording
  opsr train --preset fast --beta 0.001    150 large steps: minutes, and nearly as good; params/fast-beta-0.001.json
  opsr train --preset published            from 0.5, as published
  opsr train --preset smoke                one scene, a minute or two; params/smoke-beta-0.001.json
  opsr train --optimiser log --set steps=500 --set 'scenes=[\"rings\", \"basins\"]'
  opsr train --beta 0.001 --out mine --resume   continue after Ctrl-C

The run's folder gets config.toml, report.html and report.json, and for every beta metrics.jsonl, metrics.csv, last.ckpt, table.json and best.json (lowest validation loss). It keeps the recordings of crops until the run is complete.";

impl TrainArgs {
    /// Folder of the run.
    fn run_folder(&self) -> PathBuf {
        let default = || Path::new("out/train").join(self.settings.preset.name());
        self.run.clone().unwrap_or_else(default)
    }

    /// The existing checkpoints of a run, with their β.
    fn checkpoints(&self, config: &Config, run: &Path) -> Vec<(f32, PathBuf)> {
        let place = |&beta: &f32| (beta, run.join(self.stem(config, beta)).join(CHECKPOINT));
        let places = config.beta.iter().map(place);
        places.filter(|(_, path)| path.exists()).collect()
    }

    /// An error for --resume without a run to resume, and for a run or table that only `--force` may replace.
    fn check_places(&self, config: &Config, run: &Path) -> anyhow::Result<()> {
        let stems = config.beta.iter().map(|&beta| self.stem(config, beta));
        let stems: Vec<String> = stems.collect();
        let nothing = || self.checkpoints(config, run).is_empty() && recordings(run).is_empty();
        if self.resume && nothing() {
            let what = match std::fs::read_dir(run).map(|mut entries| entries.next().is_none()) {
                Err(_) => "there is no such run; start without --resume",
                Ok(true) => "an empty folder: nothing to resume; start without --resume",
                Ok(false) => {
                    "no checkpoint or recording of these settings to resume from; start without --resume"
                }
            };
            return Err(anyhow!("{}: {what}", run.display())).input();
        }
        if self.force {
            return Ok(());
        }
        if !self.resume && holds_a_run(run) {
            let what = "holds a run: --resume continues it, --force replaces it, --run names another folder";
            return Err(anyhow!("{} {what}", run.display())).usage();
        }
        for stem in stems {
            let table = self.out.join(format!("{stem}.json"));
            // A resumed run may replace its own table.
            let own = || std::fs::read(run.join(&stem).join("table.json")).ok();
            let ours = self.resume && std::fs::read(&table).ok() == own();
            if table.exists() && !ours {
                let what = "exists: --force replaces it, --out names another folder";
                return Err(anyhow!("{} {what}", table.display())).usage();
            }
        }
        Ok(())
    }

    /// The folder of the recordings; the run's own folder is created if necessary.
    fn kept(&self, run: &Path) -> anyhow::Result<PathBuf> {
        if let Some(folder) = &self.recordings {
            return Ok(folder.clone());
        }
        let kept = run.join(RECORDINGS);
        files::create_folder(&kept).output()?;
        Ok(kept)
    }

    /// File name of a table without its extension.
    fn stem(&self, config: &Config, beta: f32) -> String {
        let preset = match self.settings.preset {
            Preset::Full => String::new(),
            other => format!("{}-", other.name()),
        };
        let lookup = match config.lookup {
            Lookup::Nearest => "",
            Lookup::Linear => "-linear",
        };
        format!("{preset}beta-{beta}{lookup}")
    }
}

/// Name of a checkpoint in the folder of its table.
const CHECKPOINT: &str = "last.ckpt";

/// Folder of the recordings in the folder of a run.
const RECORDINGS: &str = "recordings";

/// The recordings of a run.
fn recordings(run: &Path) -> Vec<PathBuf> {
    recordings_in(&run.join(RECORDINGS))
}

/// True if a run's folder contains recordings, or folders of tables with a checkpoint or a table.
fn holds_a_run(run: &Path) -> bool {
    let work = |folder: &Path| {
        let files = [CHECKPOINT, "table.json"];
        files.iter().any(|file| folder.join(file).exists())
    };
    let mut entries = std::fs::read_dir(run).into_iter().flatten().flatten();
    !recordings(run).is_empty() || entries.any(|entry| work(&entry.path()))
}

/// Runs the command.
pub(super) fn run(args: &TrainArgs) -> anyhow::Result<Exit> {
    let config = args.settings.resolve()?;
    let run = args.run_folder();
    args.check_places(&config, &run)?;
    let stop = Stop::listen();
    super::threads::set_threads(args.threads)?;
    for dir in [&run, &args.out] {
        files::create_folder(dir).output()?;
    }
    let _claim = Claim::on(&run).output()?;
    save(&run.join("config.toml"), &config.to_toml()?)?;

    let progress = ProgressDisplay::new(args.progress, config.steps);
    if !args.resume {
        // These belong to a run that --force replaces.
        remove_recordings(&run);
    }
    let kept = args.kept(&run)?;
    let control = RecordingControl {
        folder: Some(kept.clone()),
        complete: args.recordings.is_some(),
        checkpoints: if args.resume {
            args.checkpoints(&config, &run)
        } else {
            Vec::new()
        },
        stop: stop.flag(),
        listen: &|state| {
            stop.begin();
            progress.recording(state);
        },
    };
    let mut session = match Session::open(config.clone(), &control) {
        Err(TrainError::Dataset(DatasetError::Stopped)) => {
            let (n, kept) = (recordings_in(&kept).len(), kept.display());
            progress.say(&format!(
                "stopped while recording: {kept} has {n} crops; continue with --resume"
            ));
            return Ok(Exit::Stopped);
        }
        opened => opened.map_err(blame)?,
    };
    progress.recorded();
    progress.say(&format!(
        "recorded in {:.1} s, {:.0} MB, {} of {LIVE_CLASSES} live classes visited",
        session.seconds,
        session.training.bytes() as f64 / 1e6,
        session.training.visits().live_with(1)
    ));
    let mut report = Report::new(&session);
    for &beta in &config.beta {
        let folder = run.join(args.stem(&config, beta));
        files::create_folder(&folder).output()?;
        let Some(learned) = learn(args, &mut session, beta, &folder, &progress, &stop)? else {
            return Ok(Exit::Stopped);
        };
        report.tables.push(learned);
    }
    save(
        &run.join("report.json"),
        &format!("{:#}\n", serde_json::to_value(&report)?),
    )?;
    save(&run.join("report.html"), &report.html()?)?;
    progress.say(&format!("report: {}", run.join("report.html").display()));
    if stop.asked() {
        return Ok(Exit::Stopped);
    }
    // Recordings are large and no longer needed.
    remove_recordings(&run);
    Ok(Exit::Done)
}

/// Removes the recordings of a run; a failure is only a warning, because they do no harm.
fn remove_recordings(run: &Path) {
    for path in recordings(run) {
        if let Err(error) = std::fs::remove_file(&path) {
            tracing::warn!("{}: cannot be removed: {error}", path.display());
        }
    }
    // This fails unless the folder is empty.
    let _ = std::fs::remove_dir(run.join(RECORDINGS));
}

/// Learns one table; `None` if the user stopped it.
fn learn(
    args: &TrainArgs,
    session: &mut Session,
    beta: f32,
    folder: &Path,
    progress: &ProgressDisplay,
    stop: &Stop,
) -> anyhow::Result<Option<LearnedTable>> {
    let config = session.config.clone();
    let names: Vec<String> = session.training.crops().map(|c| c.name.clone()).collect();
    let mut log = MetricsLog::open(&folder.join("metrics.jsonl"), args.resume)?;
    let resume = args.resume && folder.join(CHECKPOINT).exists();
    let clock = Instant::now();
    let mut log_error = None;
    let outcome = session
        .learn(beta, Some(folder), resume, &mut |step, loss, entry| {
            if let Some(entry) = entry
                && let Err(error) = log.add(entry)
            {
                log_error = Some(error);
                return ControlFlow::Break(());
            }
            progress.show(step, beta, loss, entry, &names, &clock);
            stop.flow()
        })
        .map_err(blame)?;
    if let Some(error) = log_error {
        return Err(error);
    }
    let seconds = clock.elapsed().as_secs_f64();
    let save_table = |path: &Path, table: &AttenuationTable, steps| {
        let provenance = Some(session.provenance(beta, outcome.start, steps));
        let table = table.clone();
        save_table_file(&TableFile { table, provenance }, path).output()
    };
    save_table(&folder.join("table.json"), &outcome.table, outcome.steps)?;
    if let Some((step, table)) = &outcome.best {
        save_table(&folder.join("best.json"), table, *step)?;
    }
    if outcome.skipped > 0 {
        progress.say(&format!(
            "skipped {} steps whose loss or gradient was not finite",
            outcome.skipped
        ));
    }
    if outcome.stopped {
        progress.say(&format!(
            "stopped after {} of {} steps; continue with --resume",
            outcome.steps, config.steps
        ));
        return Ok(None);
    }
    let path = args.out.join(format!("{}.json", args.stem(&config, beta)));
    save_table(&path, &outcome.table, outcome.steps)?;
    progress.say(&format!(
        "{}: {} steps in {seconds:.1} s",
        path.display(),
        outcome.steps
    ));
    Ok(Some(score_table(
        session,
        beta,
        outcome,
        log.entries(),
        seconds,
    )))
}

/// Scores a table for the report.
fn score_table(
    session: &mut Session,
    beta: f32,
    outcome: Outcome,
    log: Vec<serde_json::Value>,
    seconds: f64,
) -> LearnedTable {
    let lookup = session.config.lookup;
    let constant = match session.config.start > 0.0 {
        true => session.training.best_constant(beta, lookup),
        false => outcome.start,
    };
    let mut tables = vec![("learned table", &outcome.table)];
    if let Some((_, best)) = &outcome.best {
        tables.push(("table of the lowest validation loss", best));
    }
    let training = score::scores(
        &mut session.training,
        beta,
        constant,
        constant,
        &tables,
        false,
    );
    let validation = if session.validation.is_empty() {
        Vec::new()
    } else {
        let own = session.validation.best_constant(beta, lookup);
        score::scores(&mut session.validation, beta, own, constant, &tables, true)
    };
    let start = session.config.constant(outcome.start);
    LearnedTable {
        beta,
        steps: outcome.steps,
        seconds,
        log,
        training,
        validation,
        crops: CropScores::new(&mut session.training, &start, &outcome.table),
        validation_crops: CropScores::new(&mut session.validation, &start, &outcome.table),
        table: outcome.table,
    }
}

/// Attaches the exit code of a training's error.
fn blame(error: TrainError) -> anyhow::Error {
    let code = match &error {
        TrainError::Memory(_) => Exit::Memory,
        TrainError::Dataset(DatasetError::File(e)) if of_memory(e) => Exit::Memory,
        TrainError::Checkpoint(e) | TrainError::Dataset(DatasetError::File(e)) if e.is_write() => {
            Exit::Output
        }
        TrainError::State(_) | TrainError::NotFinite { .. } => Exit::Failed,
        _ => Exit::Input,
    };
    super::exit::Failure(code, error.into()).into()
}

fn save(path: &Path, text: &str) -> anyhow::Result<()> {
    files::write_bytes(path, text).output()
}
