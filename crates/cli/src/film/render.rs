//! `opsr render --frames`: the frames of an animation, rendered one after another and averaged.

use super::super::bar::{Bar, Style};
use super::super::exit::{Blame, Exit, IntoExit};
use super::super::output::note;
use super::super::render::{
    check_files, open, open_silently, remark_choice, request, request_silently, spec,
};
use super::super::render_args::RenderArgs;
use super::super::stop::Stop;
use super::super::threads::set_threads;
use super::outputs::FrameOutputs;
use super::{Film, LAYERS, of_render, read_frame, recorded};
use anyhow::anyhow;
use opsr::Aov;
use opsr::files::{self, Claim};
use opsr::image::denoise::Denoiser;
use opsr::image::exr::Metadata;
use opsr::integrator::drive::{Reason, RenderProgress};
use opsr::render::value::{Layers, Moment};
use opsr::render::{Fault, Finished, Outcome, Request, STATED, Spec};
use opsr_frames::{Frame, FrameNames, FrameRange, Surfaces};
use std::borrow::Cow;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Runs the command.
pub(in super::super) fn run(args: &RenderArgs, range: FrameRange) -> anyhow::Result<Exit> {
    let began = Instant::now();
    let (mut spec, motion) = checked(args).into_exit()?;
    let of_range = (range.first, range.numbers().len());
    let mut outputs =
        FrameOutputs::new(&args.output, &spec, (args.reproducible, motion), of_range)?;
    let denoiser = spec.denoiser().into_exit()?;
    let kept = args.checkpoint.as_deref();
    let kept = kept
        .map(|folder| KeptFrames::open(folder, args.resume))
        .transpose()?;
    let mut files: Vec<PathBuf> = range.numbers().flat_map(|n| outputs.files(n)).collect();
    files.extend(outputs.movies().map(Path::to_owned));
    check_files(args, &files, &spec, &[])?;
    set_threads(args.program.threads)?;
    spec.load_table().into_exit()?;
    spec.load_look().into_exit()?;
    let job = Job {
        args,
        range,
        spec,
        denoiser,
        kept,
        files,
        stop: Stop::listen(),
        motion,
        began,
        bar: Progress::new(args.program.progress, range),
    };
    let done = job.run(&mut outputs);
    job.bar.bar.finish();
    let exit = done?;
    let summary = outputs.summary();
    for path in outputs.end()? {
        let path = path.display();
        note(format_args!(
            "opsr: {path}: not written, the film was stopped"
        ));
    }
    if args.program.progress == Style::Auto {
        let seconds = began.elapsed().as_secs_f64();
        note(format_args!("{summary} in {seconds:.2} s"));
    }
    Ok(exit)
}

/// The options of the command line, and true if motion is requested; an error for options that a film does not have.
fn checked(args: &RenderArgs) -> Result<(Spec, bool), Fault> {
    let mut own = args.render.0.clone();
    let of_frames = own
        .aovs()
        .iter()
        .copied()
        .filter(|layer| *layer != Aov::Motion);
    let of_frames: Vec<Aov> = of_frames.collect();
    let motion = of_frames.len() < own.aovs().len();
    if motion {
        own.aov = (!of_frames.is_empty()).then_some(Layers(of_frames));
    }
    let spec = spec(args, own)?;
    let given = [
        ("--reference", args.reference.is_some()),
        ("--stats", !args.stats.is_empty()),
        ("--save-every", args.save_every.is_some()),
    ];
    if let Some((name, _)) = given.iter().find(|(_, given)| *given) {
        return Err(Fault::usage(format!(
            "{name}: for one picture, not with --frames"
        )));
    }
    if spec.at.is_some() {
        return Err(Fault::option("at", "--frames already sets the moments"));
    }
    if let Some(layer) = spec
        .aovs()
        .iter()
        .find(|layer| LAYERS.iter().all(|(kept, ..)| kept != *layer))
    {
        let why = format!(
            "{} describes a single frame, and is lost when frames are averaged",
            layer
        );
        return Err(Fault::option("aov", why));
    }
    Ok((spec, motion))
}

/// Frames as rendered, kept in a folder so that a film can be resumed.
struct KeptFrames {
    folder: PathBuf,
    resumed: bool,
    _claim: Claim,
}

impl KeptFrames {
    fn open(folder: &Path, resumed: bool) -> anyhow::Result<Self> {
        let shown = folder.display();
        if folder.is_file() {
            return Err(anyhow!(
                "--checkpoint {shown}: with --frames it is a folder, but this is a file"
            ))
            .usage();
        }
        let claim = Claim::on(folder).output()?;
        let kept = Self {
            folder: folder.to_owned(),
            resumed,
            _claim: claim,
        };
        // The folder is created with its first frame.
        let old = match folder.is_dir() {
            true => kept.names().found(),
            false => Ok(Vec::new()),
        };
        let old = old.map_err(|e| anyhow!("{shown}: {e}")).input()?;
        if !resumed && !old.is_empty() {
            let what = "has frames: --resume continues with them; remove it to start again";
            return Err(anyhow!("{shown} {what}")).usage();
        }
        Ok(kept)
    }

    fn names(&self) -> FrameNames {
        FrameNames::new(&self.folder.join("######.exr")).expect("a name with digits")
    }

    /// The file of a frame; true if an earlier run wrote it.
    fn file(&self, number: u32) -> (PathBuf, bool) {
        let file = self.names().of(number);
        let there = self.resumed && file.exists();
        (file, there)
    }
}

/// More than the number of contenders of the pilot, among which that of a kept frame is searched.
const CONTENDERS: usize = 16;

/// Keys that may differ between equal renders of a frame: the scene's name, which has a hash, and results.
const FOUND: [&str; 5] = ["scene", "spp", "refused_samples", STATED, "light_missing"];

/// The first key in which the metadata of a file differ from those of a request.
fn difference(request: &Request<'_>, file: &Metadata) -> Option<String> {
    let ours = of_render(request.metadata(0, 0));
    let theirs = of_render(file.clone());
    let mut keys = ours.keys().chain(theirs.keys());
    let differs =
        |key: &&String| !FOUND.contains(&key.as_str()) && ours.get(*key) != theirs.get(*key);
    keys.find(differs).cloned()
}

/// A film to render.
struct Job<'a> {
    args: &'a RenderArgs,
    range: FrameRange,
    spec: Spec,
    denoiser: Option<Denoiser>,
    kept: Option<KeptFrames>,
    /// The files of all frames.
    files: Vec<PathBuf>,
    stop: Stop,
    /// True to add the layer of motion.
    motion: bool,
    began: Instant,
    bar: Progress,
}

impl Job<'_> {
    fn run(&self, outputs: &mut FrameOutputs) -> anyhow::Result<Exit> {
        let (args, numbers) = (self.args, self.range.numbers());
        let (name, count) = (args.scene.display().to_string(), numbers.len());
        let (mut film, mut place) = (Film::new(self.motion), None);
        for (done, number) in numbers.enumerate() {
            let spec = self.spec_of(number, count - done);
            // Warnings and remarks are given only for the first frame.
            let opened = film.open(&args.scene, &spec, || match done {
                0 => open(&args.scene, &mut spec.clone()),
                _ => open_silently(&args.scene, &mut spec.clone()),
            })?;
            if done == 0 {
                check_files(args, &self.files, &spec, &opened.files)?;
                if opened.animations.is_empty() {
                    let what = "there are no animations, every frame is the same";
                    return Err(anyhow!("--frames: {what}")).usage();
                }
            }
            self.stop.begin();
            let mut request = match done {
                0 => request(&spec, &opened, &name)?,
                _ => request_silently(&spec, &opened, &name)?,
            };
            self.bar.begin(done);
            let frame = match self.kept.as_ref().map(|kept| kept.file(number)) {
                Some((file, true)) => Some(self.read(&mut request, &file, number, &mut place)?),
                kept => {
                    self.render(&mut request, kept.map(|(file, _)| file), number, &mut place)?
                }
            };
            let Some(frame) = frame else {
                film.end(outputs)?;
                return Ok(Exit::Stopped);
            };
            film.add(opened, frame, outputs)?;
        }
        film.end(outputs)?;
        Ok(Exit::Done)
    }

    /// The options of a frame, with its seed and its share of the time; `left` frames are still to be rendered.
    fn spec_of(&self, number: u32, left: usize) -> Spec {
        let mut spec = self.spec.clone();
        spec.at = Some(Moment::Frame(number.into(), self.range.fps));
        let seed = spec.seed.unwrap_or_default();
        spec.seed = Some(seed.wrapping_add(number.into()));
        spec.time = spec.time.map(|time| {
            let share = time.saturating_sub(self.began.elapsed()) / left as u32;
            share.max(Duration::from_millis(1))
        });
        spec
    }

    /// A kept frame; an error if this render would not make it. `place` is the contender that the pilot chose.
    fn read(
        &self,
        request: &mut Request<'_>,
        file: &Path,
        number: u32,
        place: &mut Option<usize>,
    ) -> anyhow::Result<Frame> {
        let (_, read) = recorded(file)?;
        if let Some(place) = *place {
            request.take(place);
        } else {
            *place = (0..CONTENDERS).find(|place| {
                let mut contender = request.clone();
                contender.take(*place);
                difference(&contender, &read.metadata).is_none()
            });
            request.take(place.unwrap_or(0));
        }
        let other = difference(request, &read.metadata).or_else(|| {
            let spp = self.spec.spp.map(|spp| spp.to_string());
            let same = spp.is_none() || spp.as_ref() == read.metadata.get("spp");
            (!same).then(|| "spp".to_owned())
        });
        if let Some(key) = other {
            let theirs = read.metadata.get(&key).map_or("missing", String::as_str);
            let what = format!("a frame of another render: its `{key}` is {theirs}");
            return Err(anyhow!("{}: {what}", file.display())).input();
        }
        let shape = (read.size, (read.width as u32, read.height as u32));
        if shape != (request.frame, (request.window.w, request.window.h)) {
            return Err(anyhow!("{}: a frame of another size", file.display())).input();
        }
        let frame = read_frame(file, number, read, request.camera.clone()).input()?;
        let mut wanted = LAYERS
            .iter()
            .filter(|(aov, ..)| self.spec.aovs().contains(aov));
        let has = |name: &str| frame.layers.iter().any(|layer| layer.name == name);
        match wanted.find(|(_, name, _)| !has(name)) {
            Some((aov, ..)) => {
                let what = format!("a frame without the layer {}", aov);
                Err(anyhow!("{}: {what}", file.display())).input()
            }
            None => Ok(frame),
        }
    }

    /// Renders a frame and keeps it; `None` if the user stopped it.
    fn render(
        &self,
        request: &mut Request<'_>,
        kept: Option<PathBuf>,
        number: u32,
        place: &mut Option<usize>,
    ) -> anyhow::Result<Option<Frame>> {
        if let Some(place) = *place {
            request.take(place);
        }
        let Some(begun) = request.begin(&|| !self.stop.asked()).into_exit()? else {
            return Ok(None);
        };
        if let Some(choice) = &begun.choice {
            remark_choice(self.args.program.progress, choice);
            *place = Some(choice.best);
        }
        let asked = self.stop.flag();
        let on_pass = &mut |progress: &RenderProgress, _: &_| {
            self.bar.show(progress);
            self.stop.flow()
        };
        let output = request.render(begun, Some(&asked), on_pass);
        if output.reason == Reason::Stopped {
            return Ok(None);
        }
        let (samples, seconds) = (output.progress.samples, output.progress.elapsed);
        if samples == 0 {
            let what = "its time ended within the first sample: the film ends before this frame";
            tracing::warn!("frame {number}: {what}");
            return Ok(None);
        }
        let picture = Cow::Owned(output.picture);
        let mut outcome = Outcome::of(request, picture, samples, output.missing);
        if !self.args.reproducible {
            let seconds = format!("{:.3}", seconds.as_secs_f64());
            outcome.metadata.insert("seconds".into(), seconds);
        }
        // The kept file is not rounded, so that averages from it are equal.
        outcome.spec.exr = None;
        let finished = outcome.finish_files(self.denoiser.as_ref()).into_exit()?;
        if let Some(file) = kept {
            if let Some(folder) = file.parent() {
                files::create_folder(folder).output()?;
            }
            finished.save(&file).into_exit()?;
        }
        Ok(Some(frame(request, &finished, number)))
    }
}

/// The frame of a finished render, equal to that of its file, without traced surfaces.
fn frame(request: &Request<'_>, finished: &Finished<'_>, number: u32) -> Frame {
    let Finished { outcome, shown } = finished;
    let (film, missing) = (&outcome.picture.film, outcome.missing.as_ref());
    let resolved = shown
        .resolved
        .as_ref()
        .filter(|resolved| resolved.is_known());
    Frame {
        number,
        size: request.frame,
        window: request.window,
        camera: request.camera.clone(),
        picture: shown.picture.clone(),
        error: shown.errors(film, missing).unwrap_or_default(),
        squares: resolved.map_or(Vec::new(), |resolved| resolved.squares().collect()),
        surfaces: Surfaces::default(),
        layers: outcome.aovs.clone(),
        metadata: of_render(finished.metadata()),
    }
}

/// Progress over all frames.
struct Progress {
    bar: Bar,
    range: FrameRange,
    began: Instant,
    /// Frames that are done.
    done: Cell<usize>,
}

impl Progress {
    fn new(style: Style, range: FrameRange) -> Self {
        Self {
            bar: Bar::new(style),
            range,
            began: Instant::now(),
            done: 0.into(),
        }
    }

    /// Starts the progress of a frame, after this number of finished ones.
    fn begin(&self, done: usize) {
        self.done.set(done);
    }

    fn show(&self, frame: &RenderProgress) {
        let (done, all) = (self.done.get(), self.range.numbers().len());
        let fraction = (done as f64 + frame.fraction.unwrap_or(0.0)) / all as f64;
        let of_film = RenderProgress {
            samples: frame.samples,
            elapsed: self.began.elapsed(),
            fraction: Some(fraction),
            error: None,
        };
        let number = self.range.first + done as u32;
        self.bar.show_frame(Some(number), &of_film, None);
    }
}
