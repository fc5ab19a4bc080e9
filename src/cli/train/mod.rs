//! `opsr train`: learns tables of attenuation factors from scenes.

mod display;
mod log;

use super::bar::Style;
use super::stop::Stop;
use super::{Blame, Exit};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use display::ProgressDisplay;
use log::MetricsLog;
use opsr::files;
use opsr::regularise::file::TableFile;
use opsr::regularise::{AttenuationTable, Lookup};
use opsr::report::training::{CropScores, LearnedTable, Report};
use opsr::train::config::{Config, Model};
use opsr::train::learn::outer_loop::Outcome;
use opsr::train::learn::session::RECORDING;
use opsr::train::record::crop::DatasetError;
use opsr::train::record::visits::LIVE;
use opsr::train::{RecordingControl, Session, TrainError, study};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `opsr train`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct TrainArgs {
    /// Weight of the variance against the error; several with commas make several tables from one recording.
    #[arg(long, value_name = "B", value_delimiter = ',')]
    beta: Vec<f32>,
    /// Settings to start from.
    #[arg(long, value_enum, default_value_t)]
    preset: Preset,
    /// A TOML file of settings, such as the config.toml of an earlier run.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One setting, such as spp=256; may be given several times and has the last word.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,

    /// Evaluation of the loss: tabulated (fast), replay (exact for the recording) or fresh (traces every step).
    #[arg(long, value_name = "NAME")]
    method: Option<String>,
    /// adam (published) or log (Adam on the logarithm of the factors: hundreds of steps instead of thousands).
    #[arg(long, value_name = "NAME")]
    optimiser: Option<String>,
    /// full (1360 free factors, published) or additive (24 numbers that make the factors).
    #[arg(long, value_name = "NAME")]
    model: Option<String>,
    /// Look-up of factors: nearest or linear.
    #[arg(long, value_name = "NAME")]
    lookup: Option<String>,
    /// Optimiser steps.
    #[arg(long, value_name = "N")]
    steps: Option<u32>,
    /// Samples per pixel that the tables are learned for.
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Seed of the recording; the same seed gives bit-identical tables.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Leave this family of scenes out of the training and score the tables on it.
    #[arg(long, value_name = "FAMILY")]
    hold_out: Option<String>,

    /// Folder of the run, for resolved settings, log, checkpoints, tables and report [default: out/train/PRESET].
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Folder of the finished tables.
    #[arg(long, value_name = "DIR", default_value = "params")]
    out: PathBuf,
    /// Continue from the recordings and checkpoints in the run's folder.
    #[arg(long)]
    resume: bool,
    /// Replace tables and a run that are there already; without it the program ends with exit code 2.
    #[arg(long)]
    force: bool,
    /// Then hold every family of scenes out once, and report the scores of tables on scenes unlike the training scenes.
    #[arg(long)]
    study: bool,
    /// Number of threads; all cores by default. The tables do not depend on it.
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Display of progress.
    #[arg(long, value_enum, default_value_t)]
    progress: Style,
}

const EXAMPLES: &str = "\
Examples:
  opsr train --beta 0.001,0.05 --out mine  ten thousand steps each from one recording: the shipped tables, in mine/
  opsr train --preset fast --beta 0.001    150 large steps: minutes, and nearly as good; params/fast-beta-0.001.json
  opsr train --preset published            from 0.5, as published
  opsr train --preset fast --study         scores of tables on families of scenes that they were not learned from
  opsr train --preset smoke                one scene, a minute or two; params/smoke-beta-0.001.json
  opsr train --optimiser log --set steps=500 --set 'scenes=[\"rings\", \"basins\"]'
  opsr train --beta 0.001 --out mine --resume   continue after Ctrl-C

The run's folder gets config.toml, report.html and report.json, and for every beta metrics.jsonl, metrics.csv, an event file for
TensorBoard (tensorboard --logdir out/train), last.ckpt, table.json and best.json (lowest validation loss). Recordings of crops are kept in it until the run is complete.";

/// Settings to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// All scenes, 1024 samples, ten thousand steps of Adam, from the best constant.
    #[default]
    Full,
    /// The same from 0.5, as published.
    Published,
    /// The same with 150 steps on the logarithm from the best constant: minutes.
    Fast,
    /// One scene, 256 samples, 150 steps on the logarithm.
    Smoke,
}

impl Preset {
    fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Published => "published",
            Self::Fast => "fast",
            Self::Smoke => "smoke",
        }
    }
}

impl TrainArgs {
    /// Folder of the run.
    fn run_folder(&self) -> PathBuf {
        let default = || Path::new("out/train").join(self.preset.name());
        self.run.clone().unwrap_or_else(default)
    }

    /// The checkpoints of a run, with their β.
    fn checkpoints(&self, config: &Config, run: &Path) -> Vec<(f32, PathBuf)> {
        let place = |&beta: &f32| (beta, run.join(self.stem(config, beta)).join(CHECKPOINT));
        let places = config.beta.iter().map(place);
        places.filter(|(_, path)| path.exists()).collect()
    }

    /// Refuses to resume where there is nothing to resume from, and to replace a run or a table unless `--force` says so.
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
            // A resumed run replaces the table that it made itself.
            let own = || std::fs::read(run.join(&stem).join("table.json")).ok();
            let ours = self.resume && std::fs::read(&table).ok() == own();
            if table.exists() && !ours {
                let what = "exists: --force replaces it, --out names another folder";
                return Err(anyhow!("{} {what}", table.display())).usage();
            }
        }
        Ok(())
    }

    /// Resolves the settings; later ones override earlier ones: preset, file, options, --set.
    fn resolve(&self) -> anyhow::Result<Config> {
        let mut config = Config::default();
        let preset: &[&str] = match self.preset {
            Preset::Full => &[FULL],
            Preset::Published => &[],
            Preset::Fast => &[FAST],
            Preset::Smoke => &[FAST, SMOKE],
        };
        for text in preset {
            config = config.with_text(text, "the preset").context("the preset")?;
        }
        if let Some(path) = &self.config {
            config = config.with_file(path).input()?;
        }
        if !self.beta.is_empty() {
            config.beta.clone_from(&self.beta);
        }
        let named = [
            ("method", &self.method),
            ("optimiser", &self.optimiser),
            ("model", &self.model),
            ("lookup", &self.lookup),
            ("hold_out", &self.hold_out),
        ];
        for (key, value) in named {
            if let Some(value) = value {
                config = config.with_setting(&format!("{key}={value:?}")).usage()?;
            }
        }
        config.steps = self.steps.unwrap_or(config.steps);
        config.spp = self.spp.unwrap_or(config.spp);
        config.seed = self.seed.unwrap_or(config.seed);
        for setting in &self.settings {
            config = config.with_setting(setting).usage()?;
        }
        // A file is an input; without one only the command line can be wrong.
        let checked = config.check();
        match self.config {
            Some(_) => checked.input()?,
            None => checked.usage()?,
        }
        Ok(config)
    }

    /// File name of a table without its extension.
    fn stem(&self, config: &Config, beta: f32) -> String {
        let preset = match self.preset {
            Preset::Full => String::new(),
            other => format!("{}-", other.name()),
        };
        let model = match config.model {
            Model::Full => "",
            Model::Additive => "-additive",
        };
        let lookup = match config.lookup {
            Lookup::Nearest => "",
            Lookup::Linear => "-linear",
        };
        format!("{preset}beta-{beta}{model}{lookup}")
    }
}

/// Name of a checkpoint in the folder of its table.
const CHECKPOINT: &str = "last.ckpt";

/// Folder of the recordings in the folder of a run.
const RECORDINGS: &str = "recordings";

/// The recordings of a run.
fn recordings(run: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(run.join(RECORDINGS));
    let paths = entries.into_iter().flatten().flatten().map(|e| e.path());
    paths
        .filter(|path| path.extension().is_some_and(|e| e == RECORDING))
        .collect()
}

/// True if a run's folder holds any work: recordings, or folders of tables with any.
fn holds_a_run(run: &Path) -> bool {
    let work = |folder: &Path| {
        let files = [CHECKPOINT, "table.json"];
        files.iter().any(|file| folder.join(file).exists())
    };
    let mut entries = std::fs::read_dir(run).into_iter().flatten().flatten();
    !recordings(run).is_empty() || entries.any(|entry| work(&entry.path()))
}

/// From 0.5 ten thousand steps on the training scenes end in a far worse minimum than the best constant.
const FULL: &str = "start = 0.0";

/// Few large steps.
const FAST: &str = r#"
steps = 150
optimiser = "log"
start = 0.0
validate_every = 25
checkpoint_every = 50
"#;

/// One scene and few samples, on top of [`FAST`].
const SMOKE: &str = r#"
scenes = ["cornell_caustics"]
spp = 256
"#;

/// Runs the command.
pub(super) fn run(args: &TrainArgs) -> anyhow::Result<Exit> {
    let config = args.resolve()?;
    let run = args.run_folder();
    args.check_places(&config, &run)?;
    let stop = Stop::listen();
    super::set_threads(args.threads)?;
    for dir in [&run, &args.out] {
        files::create_folder(dir).output()?;
    }
    save(&run.join("config.toml"), &config.to_toml()?)?;

    let progress = ProgressDisplay::new(args.progress, config.steps);
    let kept = run.join(RECORDINGS);
    if !args.resume {
        // Those of a run that --force replaces.
        remove_recordings(&run);
    }
    files::create_folder(&kept).output()?;
    let control = RecordingControl {
        folder: Some(kept.clone()),
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
            let (n, kept) = (recordings(&run).len(), kept.display());
            progress.say(&format!(
                "stopped while recording: {kept} has {n} crops; continue with --resume"
            ));
            return Ok(Exit::Stopped);
        }
        opened => opened.map_err(blame)?,
    };
    progress.recorded();
    progress.say(&format!(
        "recorded in {:.1} s, {:.0} MB, {} of {LIVE} live classes visited",
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
    if args.study {
        for (&beta, learned) in config.beta.iter().zip(&mut report.tables) {
            learned.held_out = study::leave_one_out(&mut session, beta, &mut |family| {
                progress.say(&format!("beta {beta}: learning without {family}"));
                stop.flow()
            })
            .map_err(blame)?;
            if !session.validation.is_empty() && !stop.asked() {
                progress.say(&format!(
                    "beta {beta}: running a pilot for every validation crop"
                ));
                let scores = study::piloted(
                    &mut session.validation,
                    beta,
                    "learned table, pilot's scale and contrast",
                    &learned.table,
                    config.spp,
                );
                learned.validation.extend(scores.map_err(blame)?);
            }
        }
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
    // Large, and of use no longer.
    remove_recordings(&run);
    Ok(Exit::Done)
}

/// Removes the recordings of a run; one that cannot be removed is in nobody's way.
fn remove_recordings(run: &Path) {
    for path in recordings(run) {
        if let Err(error) = std::fs::remove_file(&path) {
            tracing::warn!("{}: cannot be removed: {error}", path.display());
        }
    }
    // Only if it is empty.
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
        TableFile { table, provenance }.save(path).output()
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
    Ok(Some(score(session, beta, outcome, log.entries(), seconds)))
}

/// Scores a table for the report.
fn score(
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
    let training = study::scores(
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
        study::scores(&mut session.validation, beta, own, constant, &tables, true)
    };
    let start = session.config.constant(outcome.start);
    LearnedTable {
        beta,
        steps: outcome.steps,
        seconds,
        log,
        training,
        validation,
        held_out: Vec::new(),
        crops: CropScores::new(&mut session.training, &start, &outcome.table),
        validation_crops: CropScores::new(&mut session.validation, &start, &outcome.table),
        table: outcome.table,
    }
}

/// Attaches the exit code of a training's error.
fn blame(error: TrainError) -> anyhow::Error {
    let code = match &error {
        TrainError::Memory(_) => Exit::Memory,
        TrainError::Dataset(DatasetError::File(e)) if e.is_shortage() => Exit::Memory,
        TrainError::Checkpoint(e) if e.is_write() => Exit::Output,
        TrainError::State(_) | TrainError::NotFinite { .. } => Exit::Failed,
        _ => Exit::Input,
    };
    super::Failure(code, error.into()).into()
}

fn save(path: &Path, text: &str) -> anyhow::Result<()> {
    files::write_bytes(path, text).output()
}
