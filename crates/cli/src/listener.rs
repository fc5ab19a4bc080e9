//! Callback of a render: shows progress and the true error, saves files and checkpoints, writes the log.

use super::bar::Bar;
use super::error_log::{ErrorLog, Line};
use super::exit::{Blame, IntoExit, failure};
use super::output::command;
use super::pace::Pace;
use super::render_args::RenderArgs;
use super::stop::Stop;
use crate::outputs::Outputs;
use anyhow::{Context, anyhow};
use opsr::image::Buffer;
use opsr::image::denoise::Denoiser;
use opsr::image::film::Film;
use opsr::integrator::Picture;
use opsr::integrator::drive::RenderProgress;
use opsr::pilot::witness::MissingLight;
use opsr::render::{Fault, Finished, Outcome, Output, Request};
use opsr::resolve::{stated_error, unseen_share};
use opsr_lab::report::compare::Named;
use opsr_metric::mean_relative_error;
use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

/// Default of the least time between checkpoints.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Least time between error estimates during a render.
const ERRORS_EVERY: Duration = Duration::from_secs(1);

/// A run of a render; earlier runs may have begun the same render.
pub(super) struct Run<'a> {
    pub(super) args: &'a RenderArgs,
    pub(super) request: &'a Request<'a>,
    pub(super) outputs: &'a Outputs,
    pub(super) denoiser: Option<&'a Denoiser>,
    pub(super) stop: &'a Stop,
    /// Samples of earlier runs.
    pub(super) start: u32,
    /// Seconds of earlier runs.
    pub(super) spent: f64,
}

/// Results of a run.
pub(super) struct Saved {
    pub(super) finished: Finished<'static>,
    /// Share of the light that only roughened lobes find.
    pub(super) unseen: f64,
    /// Mean relative error against the reference, if there is one.
    pub(super) true_error: Option<f64>,
    /// Error of a result that could not be saved.
    pub(super) failed: Option<anyhow::Error>,
}

/// Callback after every pass of a run.
pub(super) struct RenderCallback<'a> {
    run: Run<'a>,
    bar: Bar,
    truth: Option<Reference>,
    log: Option<ErrorLog>,
    /// Pace of the error estimates during the render; `None` if nothing shows them.
    errors: Option<Pace>,
    /// The latest error against the reference.
    true_error: Option<f64>,
    /// Pace of files and checkpoint; `None` if only the final ones are written.
    saves: Option<Pace>,
    /// Error that made the log incomplete.
    unlogged: Option<anyhow::Error>,
}

impl<'a> RenderCallback<'a> {
    /// Opens the log and reads the reference.
    pub(super) fn open(run: Run<'a>, picture: &Picture) -> anyhow::Result<Self> {
        let args = run.args;
        let truth = match &args.reference {
            Some(path) => Some(Reference::load(path, &picture.film)?),
            None => None,
        };
        let log = match args.log() {
            Some(path) => Some(ErrorLog::open(path, run.start)?),
            None => None,
        };
        let is_seen = truth.is_some() || log.is_some();
        let checkpoints = args.checkpoint.as_ref().map(|_| CHECKPOINT_EVERY);
        let every = args.save_every.or(checkpoints);
        Ok(Self {
            bar: Bar::new(args.program.progress),
            run,
            truth,
            log,
            errors: is_seen.then(|| Pace::at_once(ERRORS_EVERY)),
            true_error: None,
            saves: every.map(Pace::after),
            unlogged: None,
        })
    }

    /// Runs after every pass; breaks if the user requested an end. The render continues if a file cannot be saved now.
    pub(super) fn on_pass(
        &mut self,
        progress: &RenderProgress,
        picture: &Picture,
    ) -> ControlFlow<()> {
        if let Some(mut pace) = self.errors.take_if(|pace| pace.is_due()) {
            pace.spend(|| self.look(progress, picture));
            self.errors = Some(pace);
        }
        self.bar.show(progress, self.true_error);
        if let Err(error) = self.save_now_and_then(progress, picture) {
            tracing::warn!("{error:#}; the render continues and tries again");
        }
        self.run.stop.flow()
    }

    /// Estimates the errors of the picture so far, and logs them.
    fn look(&mut self, progress: &RenderProgress, picture: &Picture) {
        let spec = &self.run.request.spec;
        let shown = self
            .truth
            .as_ref()
            .map(|truth| truth.error(&spec.shown(picture)));
        self.true_error = shown.flatten();
        if self.log.is_none() {
            return;
        }
        let stated = stated_error(picture, spec.resolve()).mean;
        if let Err(error) = self.log(progress, stated, self.true_error) {
            tracing::warn!("{error:#}; the log ends here");
            (self.log, self.unlogged) = (None, Some(error));
        }
    }

    /// Finishes the picture and saves it, the checkpoint and the log. All are tried, even if one fails.
    pub(super) fn close(mut self, output: Output) -> anyhow::Result<Saved> {
        let Output {
            picture, progress, ..
        } = output;
        self.bar.finish();
        let kept = self.checkpoint(&progress, &picture);
        let unseen = unseen_share(&picture);
        let finished = self.finished(Cow::Owned(picture), &progress, output.missing)?;
        let written = self.write(&finished);
        let unwritten = written.err().map(|fault| failure(&fault).into());
        let shown = &finished.shown.picture;
        let true_error = (self.truth.as_ref()).and_then(|truth| truth.error(shown));
        // The last line of the log has the error of the closing line.
        let stated = finished.statement().mean;
        let logged = self.log(&progress, stated, true_error);
        let failed = unwritten.or(kept.err()).or(self.unlogged).or(logged.err());
        Ok(Saved {
            finished,
            unseen,
            true_error,
            failed,
        })
    }

    /// Seconds of this run and earlier ones.
    fn seconds(&self, progress: &RenderProgress) -> f64 {
        self.run.spent + progress.elapsed.as_secs_f64()
    }

    fn log(
        &mut self,
        progress: &RenderProgress,
        stated: f64,
        true_error: Option<f64>,
    ) -> anyhow::Result<()> {
        let seconds = self.seconds(progress);
        let Some(log) = &mut self.log else {
            return Ok(());
        };
        log.add(Line {
            samples: progress.samples,
            seconds,
            estimated: stated,
            true_error,
        })
    }

    /// Writes files and checkpoint if they are due.
    fn save_now_and_then(
        &mut self,
        progress: &RenderProgress,
        picture: &Picture,
    ) -> anyhow::Result<()> {
        let Some(mut pace) = self.saves.take_if(|pace| pace.is_due()) else {
            return Ok(());
        };
        let saved = pace.spend(|| self.save(progress, picture));
        self.saves = Some(pace);
        saved
    }

    /// Writes the checkpoint and, with `--save-every`, the files.
    fn save(&self, progress: &RenderProgress, picture: &Picture) -> anyhow::Result<()> {
        let unwritten = match self.run.args.save_every {
            Some(_) => {
                let finished = self.finished(Cow::Borrowed(picture), progress, None)?;
                self.write(&finished).err()
            }
            None => None,
        };
        self.checkpoint(progress, picture)?;
        unwritten.map_or(Ok(()), |fault| Err(failure(&fault).into()))
    }

    /// The picture so far, as in its files.
    fn finished<'p>(
        &self,
        picture: Cow<'p, Picture>,
        progress: &RenderProgress,
        missing: Option<MissingLight>,
    ) -> anyhow::Result<Finished<'p>> {
        let Run { request, args, .. } = &self.run;
        let mut outcome = Outcome::of(request, picture, progress.samples, missing);
        if !args.reproducible {
            let metadata = &mut outcome.metadata;
            metadata.insert("command".into(), command());
            metadata.insert("seconds".into(), format!("{:.3}", self.seconds(progress)));
            let threads = rayon::current_num_threads();
            metadata.insert("threads".into(), threads.to_string());
        }
        outcome.finish_files(self.run.denoiser).into_exit()
    }

    /// Writes the picture's files, with a warning for each file that another program has changed.
    fn write(&self, finished: &Finished<'_>) -> Result<(), Fault> {
        for file in self.run.outputs.changed() {
            let what = "was changed by another program during this render, and is replaced";
            tracing::warn!("{}: {what}", file.display());
        }
        self.run.outputs.write(finished)
    }

    fn checkpoint(&self, progress: &RenderProgress, picture: &Picture) -> anyhow::Result<()> {
        // A checkpoint has whole samples only.
        let whole = |_: &&_| progress.samples > 0;
        let Some(path) = self.run.args.checkpoint.as_ref().filter(whole) else {
            return Ok(());
        };
        let kept = self
            .run
            .request
            .checkpoint(progress, self.run.spent, picture);
        kept.save(path).output()
    }
}

/// The reference of a render.
struct Reference {
    reference: Buffer,
}

impl Reference {
    fn load(path: &Path, film: &Film) -> anyhow::Result<Self> {
        let (name, window) = (path.display(), film.window);
        let reference = Named::load(path).input()?.showing(film.size, window);
        let wrong = || anyhow!("--reference {name}: does not show the {window} of this render");
        let reference = reference.ok_or_else(wrong).usage()?;
        mean_relative_error(&reference, &reference)
            .with_context(|| name.to_string())
            .input()?;
        Ok(Self { reference })
    }

    /// Mean relative error against the reference.
    fn error(&self, picture: &Buffer) -> Option<f64> {
        Some(mean_relative_error(picture, &self.reference).ok()?.value)
    }
}
