//! `opsr render`: renders a scene to picture files.

use super::bar::Style;
use super::ended::FinishedRender;
use super::exit::{Blame, Exit, IntoExit};
use super::film;
use super::listener::{RenderCallback, Run};
use super::output::note;
use super::render_args::RenderArgs;
use super::stop::Stop;
use super::threads::set_threads;
use crate::outputs::{Outputs, check_distinct, check_layers};
use anyhow::anyhow;
use opsr::Aov;
use opsr::bsdf::Distribution;
use opsr::files::{self, Claim};
use opsr::image::denoise::Denoiser;
use opsr::image::level_film::LevelFilm;
use opsr::integrator::Picture;
use opsr::integrator::drive::{Reason, RenderProgress};
use opsr::integrator::method::IntegratorKind;
use opsr::pilot::Choice;
use opsr::regularise::file::TableFile;
use opsr::regularise::{Factors, Rule};
use opsr::render::can_write;
use opsr::render::look::CameraChoice;
use opsr::render::open::Opened;
use opsr::render::value::TableChoice;
use opsr::render::{Fault, PreparedRender, Request, Spec, Subject};
use opsr::scene::Scene;
use opsr_formats::FORMATS;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the command.
pub(super) fn run(args: &RenderArgs) -> anyhow::Result<Exit> {
    if let Some(range) = args.frames {
        return film::render::run(args, range);
    }
    let began = Instant::now();
    let mut spec = spec(args, args.render.0.clone()).into_exit()?;
    check_layers(&spec, &args.output).into_exit()?;
    let outputs = Outputs::new(&args.output).into_exit()?;
    let denoiser = spec.denoiser().into_exit()?;
    for path in args.others() {
        can_write(path).into_exit()?;
    }
    check_files(args, &args.output, &spec, &[])?;
    let _claim = args
        .checkpoint
        .as_deref()
        .map(Claim::on)
        .transpose()
        .output()?;
    set_threads(args.program.threads)?;
    let stop = Stop::listen();
    // Before `begin`, Ctrl-C ends the program at once.
    let opened = open(&args.scene, &mut spec)?;
    check_files(args, &args.output, &spec, &opened.files)?;
    stop.begin();
    let name = args.scene.display().to_string();
    let request = request(&spec, &opened, &name)?;
    RenderJob {
        args,
        outputs,
        denoiser,
        opened: &opened,
        stop,
        began,
    }
    .run(request)
}

/// The options of the command line, checked.
pub(super) fn spec(args: &RenderArgs, spec: Spec) -> Result<Spec, Fault> {
    spec.check()?;
    args.check()?;
    if args.reproducible && spec.aovs().contains(&Aov::Time) {
        let what = "times differ from render to render: not with {reproducible}";
        return Err(Fault::option("aov", what));
    }
    Ok(spec)
}

/// Reads the files of a spec and opens the scene, with its warnings; an error for a scene without light.
pub(super) fn open(scene: &Path, spec: &mut Spec) -> anyhow::Result<Opened> {
    let opened = open_silently(scene, spec)?;
    for warning in &opened.warnings {
        tracing::warn!("{}: {warning}", scene.display());
    }
    Ok(opened)
}

/// Opens a scene as [`open`] does, without its warnings.
pub(super) fn open_silently(scene: &Path, spec: &mut Spec) -> anyhow::Result<Opened> {
    spec.load_table().into_exit()?;
    spec.load_look().into_exit()?;
    let opened = spec.open(scene, FORMATS, Scene::new).into_exit()?;
    if opened.scene.lights().is_empty() {
        let what = "nothing lights the scene: --env studio, --env sky or a map would";
        return Err(anyhow!("{}: {what}", scene.display())).input();
    }
    Ok(opened)
}

/// The request of a spec for the scene of the file `name`, with remarks on it.
pub(super) fn request<'a>(
    spec: &Spec,
    opened: &'a Opened,
    name: &'a str,
) -> anyhow::Result<Request<'a>> {
    let request = request_silently(spec, opened, name)?;
    remark(&request);
    Ok(request)
}

/// The request of a spec, as [`request`] makes it, without remarks.
pub(super) fn request_silently<'a>(
    spec: &Spec,
    opened: &'a Opened,
    name: &'a str,
) -> anyhow::Result<Request<'a>> {
    let subject = Subject {
        scene: &opened.scene,
        name,
        sha256: &opened.sha256,
        in_studio: opened.in_studio,
    };
    Request::new(spec, subject, None).into_exit()
}

/// Reports choices that were made for the user, and options that do not fit together.
fn remark(request: &Request<'_>) {
    if request.method.table_scenes == Some(1) {
        tracing::warn!(
            "--opsr-table: a table of one scene, such as that of --preset smoke, does not suit others"
        );
    }
    let ggx = request.spec.distribution == Some(Distribution::Ggx);
    let learned = matches!(
        &request.settings.rule,
        Rule::Accumulated(rule) if matches!(rule.factors, Factors::Table(_))
    );
    if ggx && learned {
        tracing::warn!("--distribution ggx: tables are learned for Beckmann lobes");
    }
    for note in &request.notes {
        tracing::info!("{note}");
    }
}

/// Reports the chosen integrator with the reason, and with --verbose the results of the pilot.
pub(super) fn remark_choice(style: Style, choice: &Choice) {
    match style {
        Style::Auto => note(choice.summary()),
        Style::Json | Style::None => {}
    }
    tracing::info!("{choice}");
}

/// An error if two outputs are one file, or if an output is an input.
pub(super) fn check_files(
    args: &RenderArgs,
    pictures: &[PathBuf],
    spec: &Spec,
    read: &[PathBuf],
) -> anyhow::Result<()> {
    let outputs = pictures.iter().chain(args.others());
    let inputs = read.iter().chain(&args.reference).chain([&args.scene]);
    let inputs = inputs.map(PathBuf::as_path).chain(spec_files(spec));
    check_distinct(outputs.map(PathBuf::as_path), inputs).into_exit()
}

/// The files that a spec names.
pub(super) fn spec_files(spec: &Spec) -> impl Iterator<Item = &Path> {
    let table = spec.table.as_ref().and_then(|table| match table {
        TableChoice::File(path) if path.exists() || !TableFile::is_built_in(path) => Some(&**path),
        _ => None,
    });
    let camera = spec.camera.as_ref().and_then(|camera| match camera {
        CameraChoice::File(path) => Some(&**path),
        CameraChoice::Named(_) | CameraChoice::Numbers(_) => None,
    });
    let env = spec.env.as_deref();
    env.into_iter().chain(table).chain(camera)
}

/// A render to files.
pub(super) struct RenderJob<'a> {
    args: &'a RenderArgs,
    outputs: Outputs,
    denoiser: Option<Denoiser>,
    opened: &'a Opened,
    stop: Stop,
    /// Start of the command: --time includes loading and pilots.
    began: Instant,
}

impl RenderJob<'_> {
    fn run(&self, mut request: Request<'_>) -> anyhow::Result<Exit> {
        let args = self.args;
        if let Some(path) = &args.checkpoint {
            self.continued(&mut request, path)?;
        }
        if request.spec.kind() == IntegratorKind::Auto {
            tracing::info!("the pilot begins");
        }
        let Some(mut begun) = request.begin(&|| !self.stop.asked()).into_exit()? else {
            note("opsr: stopped before the first sample; nothing was written");
            return Ok(Exit::Stopped);
        };
        if let Some(choice) = &begun.choice {
            remark_choice(args.program.progress, choice);
        }
        begun.pilot = self.began.elapsed();
        let PreparedRender { start, spent, .. } = begun;
        let levels = request.settings.amounts.films();
        if levels > 1 && start == 0 {
            let bytes = LevelFilm::bytes(request.window.len(), levels);
            tracing::info!("{levels} levels take {} MB", bytes / 1_000_000);
        }
        if let Some(notes) = request.settings.integrator().notes(&request.view()) {
            tracing::info!("{notes}");
        }
        let run = Run {
            args,
            request: &request,
            outputs: &self.outputs,
            denoiser: self.denoiser.as_ref(),
            stop: &self.stop,
            start,
            spent,
        };
        let mut listener = RenderCallback::open(run, &begun.picture)?;
        let on_pass =
            &mut |progress: &RenderProgress, picture: &Picture| listener.on_pass(progress, picture);
        let asked = self.stop.flag();
        let output = request.render(begun, Some(&asked), on_pass);
        let samples = output.progress.samples;
        if samples == 0 && output.picture.film.pixels.iter().all(|m| m.n == 0) {
            note("opsr: stopped before any of the first sample was done; nothing was written");
            return Ok(Exit::Stopped);
        }
        if samples == 0 {
            tracing::warn!(
                "stopped within the first sample: the picture holds its finished part, and there is no checkpoint"
            );
        }
        let (progress, reason) = (output.progress, output.reason);
        let saved = listener.close(output)?;
        let ended = FinishedRender {
            args,
            request: &request,
            opened: self.opened,
            progress,
            start,
            spent,
            saved: &saved,
        };
        if let Some(path) = args.report() {
            let text = format!("{:#}\n", ended.statistics(&self.outputs));
            files::write_bytes(path, text).output()?;
        }
        if let Some(error) = saved.failed {
            return Err(error);
        }
        ended.report(&self.outputs);
        Ok(if reason == Reason::Stopped || samples == 0 {
            Exit::Stopped
        } else {
            Exit::Done
        })
    }

    /// Resumes from the checkpoint with --resume; an error for an existing checkpoint without it.
    fn continued(&self, request: &mut Request<'_>, path: &Path) -> anyhow::Result<()> {
        if self.args.resume {
            return request.resume(path).into_exit();
        }
        if path.exists() {
            let path = path.display();
            let what = "exists: --resume continues from it; remove it to start again";
            return Err(anyhow!("{path} {what}")).usage();
        }
        Ok(())
    }
}
