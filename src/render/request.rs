//! A spec checked against a scene, and its run.

use super::fault::Fault;
use super::look::CameraChoice;
use super::method::Method;
use super::spec::{Heading, Opt, Spec};
use super::value::{Crop, LensChoice, Levels, word};
use crate::image::film::{Film, Window};
use crate::integrator::checkpoint::{Checkpoint, Fingerprint};
use crate::integrator::drive::{Budget, ErrorBound, Reason, RenderProgress, drive};
use crate::integrator::layers::Aov;
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Amounts, Estimator, Picture, Recorded, Settings, Stop, View};
use crate::math::UVec2;
use crate::memory;
use crate::pilot::witness::{MissingLight, missing_light};
use crate::pilot::{
    Choice, Contender, Horizon, SPP_OF_TARGET, choose_integrator, left_after, with_a_first_sample,
};
use crate::resolve::{Resolve, stopping_error, stopping_error_of_samples};
use crate::scene::{Camera, Lens, Scene};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Samples per pixel of a render without a given limit.
pub(crate) const DEFAULT_SPP: u32 = 128;

/// Bytes per pixel that a layer for one level adds.
const LEVEL_LAYER_BYTES: u64 = 36;

/// The scene of a render.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its file name, for metadata; empty for a scene without a file.
    pub name: &'a str,
    /// SHA-256 of its files.
    pub sha256: &'a str,
    /// True if the built-in studio lights it.
    pub in_studio: bool,
}

/// A render that can be run.
#[derive(Clone)]
pub struct Request<'a> {
    /// The user's choices.
    pub spec: Spec,
    /// The scene.
    pub subject: Subject<'a>,
    /// The camera with its lens.
    pub camera: Camera,
    /// Columns and rows of the whole picture.
    pub frame: UVec2,
    /// The part that is rendered.
    pub window: Window,
    /// Settings that determine the picture; those of the path tracer until a pilot has chosen.
    pub settings: Settings,
    /// The integrator by its name in options.
    pub kind: IntegratorKind,
    /// The method of the settings.
    pub method: Method,
    /// The options behind the settings: the user's, or those of the contender that a pilot chose.
    own: Spec,
    /// Remarks on automatic choices.
    pub notes: Vec<String>,
    /// Candidates for a pilot, with their methods.
    contenders: Vec<(Contender, Method, Spec)>,
    /// Checkpoint of the render that this one continues.
    old: Option<Checkpoint>,
}

/// A render before its first pass.
pub struct PreparedRender {
    /// The picture to continue.
    pub picture: Picture,
    /// Number of its samples per pixel.
    pub start: u32,
    /// Seconds spent on them.
    pub spent: f64,
    /// Time of the pilot, and of loading if --time counts it.
    pub pilot: Duration,
    /// Choice of the pilot, if there was one.
    pub choice: Option<Choice>,
}

/// A render that has ended.
pub struct Output {
    /// The moments of every pixel, and the data recorded beside them.
    pub picture: Picture,
    /// State at the end.
    pub progress: RenderProgress,
    /// The limit that ended it.
    pub reason: Reason,
    /// Light that a witness found missing in the picture.
    pub missing: Option<MissingLight>,
}

/// Callback after each pass, with the picture so far. It can end the render.
pub(crate) type OnPass<'a> = &'a mut dyn FnMut(&RenderProgress, &Picture) -> ControlFlow<()>;

/// Runs a render: the pilot, if the integrator is `auto`, and all passes.
pub fn run<'a>(
    mut request: Request<'a>,
    on_pass: OnPass<'_>,
) -> Result<(Request<'a>, Output), Fault> {
    let begun = request.begin(&|| true)?;
    // The callback never stops it.
    let begun = begun.ok_or_else(|| Fault::usage("stopped before the first sample"))?;
    let output = request.render(begun, None, on_pass);
    Ok((request, output))
}

/// The camera with this name or number; without one the first, or else a camera that frames the whole scene.
pub(crate) fn camera(scene: &Scene, wanted: Option<&str>, aspect: f32) -> Result<Camera, Fault> {
    let cameras = &scene.parts().cameras;
    let Some(wanted) = wanted else {
        let first = cameras.first().cloned();
        return Ok(first.unwrap_or_else(|| scene.framing_camera(aspect)));
    };
    let by_name = cameras.iter().find(|c| c.name == wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| cameras.get(i));
    by_name.or_else(by_number).cloned().ok_or_else(|| {
        let names = cameras.iter().enumerate();
        let names = names.map(|(i, c)| format!("camera {i} (`{}`)", c.name));
        let names = names.collect::<Vec<_>>().join(", ");
        let has = if names.is_empty() { "none" } else { &names };
        Fault::Input(format!(
            "no camera `{wanted}`: the scene has {has}; a file of a camera ends in .json"
        ))
    })
}

impl Spec {
    /// Loads the table into the spec, so that it is read once.
    pub fn load_table(&mut self) -> Result<(), Fault> {
        if let Some(choice) = &mut self.table {
            choice.load()?;
        }
        Ok(())
    }

    /// Columns and rows of the whole picture.
    pub fn frame(&self, scene: &Scene) -> Result<UVec2, Fault> {
        use super::value::Size;
        if let Some(Size::Pixels(size)) = self.size {
            return Ok(size);
        }
        let whole = match self.looking()?.filter(|look| look.aspect.is_some()) {
            Some(look) => look.default_frame(),
            None => camera(scene, self.camera_name(), 1.0)?.default_frame(),
        };
        Ok(self.size.unwrap_or(Size::Share(1.0)).of(whole))
    }

    /// Name or number of the requested camera.
    fn camera_name(&self) -> Option<&str> {
        match &self.camera {
            Some(CameraChoice::Named(name)) => Some(name),
            _ => None,
        }
    }

    /// The requested lens; `file` is the lens of the camera in its file.
    fn lens(&self, file: Option<Lens>) -> Result<Option<Lens>, Fault> {
        let Some(LensChoice { radius, focus }) = self.lens else {
            return Ok(file);
        };
        if radius == 0.0 {
            return Ok(None);
        }
        let focus = focus.or(file.map(|lens| lens.focus));
        let why =
            "needs a distance in focus too, such as 0.1,2.5: the camera has no lens of its own";
        let focus = focus.ok_or_else(|| Fault::option("lens", why))?;
        Ok(Some(Lens { radius, focus }))
    }

    /// The camera of a frame, with its lens.
    pub fn camera(&self, scene: &Scene, frame: UVec2) -> Result<Camera, Fault> {
        let camera = match self.looking()? {
            Some(look) => look,
            None => camera(scene, self.camera_name(), frame.x as f32 / frame.y as f32)?,
        };
        self.through(camera)
    }

    /// A camera with the requested lens.
    fn through(&self, camera: Camera) -> Result<Camera, Fault> {
        let lens = self.lens(camera.lens)?;
        Ok(Camera { lens, ..camera })
    }

    /// The settings of a method with the requested amounts, or the usual ones, and the reason if raw means replace the
    /// usual amounts.
    fn levelled(
        &self,
        method: &Method,
        has_lobes: bool,
    ) -> Result<(Settings, Option<String>), Fault> {
        let mut settings = self.with(method);
        if self.is_raw() {
            return Ok((settings, None));
        }
        if let Some(levels) = &self.levels {
            let amounts = match levels {
                Levels::None => Ok(Amounts::Blurred),
                Levels::At(numbers) => settings.amounts_at(numbers),
            };
            let checked = amounts.and_then(|amounts| {
                settings.amounts = amounts;
                settings.check_amounts()
            });
            checked.map_err(|e| Fault::option("levels", e))?;
            return Ok((settings, None));
        }
        match settings.usual_amounts(has_lobes) {
            Ok(Amounts::Blurred) if self.splits_light() => {
                return Ok((
                    settings,
                    Some(
                        "no blurs: emission, direct and indirect add up to the picture without"
                            .into(),
                    ),
                ));
            }
            Ok(amounts) => settings.amounts = amounts,
            Err(why) => return Ok((settings, Some(format!("one level: {why}")))),
        }
        Ok((settings, None))
    }

    /// Limits of the render, after a pilot that took this long.
    pub(crate) fn budget(&self, pilot: Duration) -> Budget {
        let free = self.spp.is_none() && self.time.is_none() && self.target_error.is_none();
        Budget {
            samples: if free { Some(DEFAULT_SPP) } else { self.spp },
            time: self.time.map(|time| match pilot {
                Duration::ZERO => time,
                pilot => left_after(time, pilot),
            }),
            error: self.target_error.map(|bound| ErrorBound {
                bound: bound.into(),
                estimate: match self.resolve() {
                    Resolve::None => stopping_error_of_samples,
                    _ => stopping_error,
                },
            }),
        }
    }

    /// Length of the render that a pilot plans for.
    fn horizon(&self) -> Horizon {
        let threads = rayon::current_num_threads() as f64;
        match (self.spp, self.time) {
            (Some(spp), _) => Horizon::Samples(spp),
            (None, Some(time)) => Horizon::Seconds(time.as_secs_f64() * threads),
            (None, None) if self.target_error.is_some() => Horizon::Samples(SPP_OF_TARGET),
            (None, None) => Horizon::Samples(DEFAULT_SPP),
        }
    }

    /// AOVs that are recorded along paths.
    pub(crate) fn recorded_aovs(&self) -> Recorded {
        let mut recorded = Aov::recorded(self.aovs());
        recorded.first |= self.denoise == Some(true);
        recorded
    }
}

impl<'a> Request<'a> {
    /// Checks a spec against a scene. `own` is a camera that replaces those of the scene.
    pub fn new(spec: &Spec, subject: Subject<'a>, own: Option<Camera>) -> Result<Self, Fault> {
        let mut spec = spec.clone();
        spec.check()?;
        spec.load_table()?;
        spec.load_look()?;
        let scene = subject.scene;
        let frame = spec.frame(scene)?;
        let camera = match own {
            Some(camera) => spec.through(camera)?,
            None => spec.camera(scene, frame)?,
        };
        let own = camera
            .film
            .and_then(|film| film.crop)
            .filter(|_| spec.size.is_none());
        let own = own.map(|[x, y, w, h]| Crop::pixels(x, y, w, h));
        spec.crop = spec.crop.or(own);
        let window = spec.crop.map_or(Window::full(frame), |crop| crop.of(frame));
        Film::check(frame, window).map_err(|e| Fault::option(spec.window_option(), e))?;
        let kind = spec.kind();
        let mut contenders = Vec::new();
        let mut notes = Vec::new();
        let specs = match kind {
            IntegratorKind::Auto => spec.contenders(),
            _ => vec![spec.clone()],
        };
        for one in specs {
            let method = one.method()?;
            let (settings, note) = one.levelled(&method, scene.features().lobes)?;
            // The built-in table serves only for levels.
            let own_table = one.table.is_some() && spec.table.is_none();
            if own_table && !settings.amounts.has_choice() {
                continue;
            }
            match one.check_resolved(&settings) {
                Err(fault) if contenders.is_empty() => return Err(fault),
                Err(_) => continue,
                Ok(()) => {}
            }
            if kind != IntegratorKind::Auto {
                notes.extend(note);
            }
            let kind = one.kind();
            contenders.push((Contender { kind, settings }, method, one));
        }
        let (first, method, own) = contenders[0].clone();
        if kind != IntegratorKind::Auto {
            contenders.clear();
            let checked = first.settings.check_scene(scene);
            checked.map_err(|what| Fault::option("integrator", what))?;
        }
        let request = Self {
            spec,
            subject,
            camera,
            frame,
            window,
            settings: first.settings,
            kind: first.kind,
            method,
            own,
            notes,
            contenders,
            old: None,
        };
        request.check_memory()?;
        Ok(request)
    }

    /// The part of the frame that is rendered.
    pub fn view(&self) -> View<'_> {
        View::new(self.subject.scene, &self.camera, self.frame, self.window)
    }

    /// An error for a picture that needs more memory than is available.
    fn check_memory(&self) -> Result<(), Fault> {
        let (frame, window) = (self.frame, self.window);
        let films = self.settings.amounts.films();
        let mut bytes = self
            .settings
            .bytes(frame, window, self.spec.recorded_aovs());
        if self.spec.aovs().contains(&Aov::EachLevel) {
            bytes += (window.len() * films) as u64 * LEVEL_LAYER_BYTES;
        }
        // Markov chains cover the whole frame.
        let (size, hint) = match self.settings.estimator {
            Estimator::Mlt { .. } => (frame, "{size} makes the picture smaller"),
            _ => (
                UVec2::new(window.w, window.h),
                "{crop} renders a part of a picture",
            ),
        };
        let mut what = format!("{}x{} pixels", size.x, size.y);
        if films > 1 {
            what += &format!(" of {films} levels");
        }
        memory::check(what, bytes).map_err(|shortage| Fault::Memory(shortage, hint))
    }

    /// Continues from a checkpoint; an error if its scene or settings differ.
    pub fn resume(&mut self, path: &Path) -> Result<(), Fault> {
        let old = Checkpoint::open(path)?;
        let theirs = old.fingerprint.clone();
        let ours = |settings: &Settings| self.identity(settings, true) == theirs;
        let place = self.contenders.iter().position(|(c, ..)| ours(&c.settings));
        // If no contender matches the checkpoint, the most similar one gives the error.
        let alike = |(c, ..): &(Contender, Method, Spec)| {
            let levels = old.amounts.has_choice() == c.settings.amounts.has_choice();
            levels && old.metadata.get("integrator") == Some(&word(&c.kind))
        };
        let place = place.or_else(|| self.contenders.iter().position(alike));
        self.take(place.unwrap_or(0));
        old.check(path, &self.fingerprint())?;
        self.old = Some(old);
        Ok(())
    }

    /// Takes the contender at `place`, the choice of a pilot for a request with equal scene, light and method. Does
    /// nothing without contenders.
    pub fn take(&mut self, place: usize) {
        if let Some((contender, method, own)) = self.contenders.get(place).cloned() {
            (self.kind, self.settings) = (contender.kind, contender.settings);
            (self.method, self.own) = (method, own);
            self.contenders.clear();
        }
    }

    /// Lets a pilot choose the integrator, if it is open: for the whole frame, so that crops and parts choose alike, or
    /// with a time limit for the rendered part. Returns the choice, if there was one. Breaks if `go_on`, which is
    /// called before every small render, returns false.
    pub fn choose(
        &mut self,
        go_on: &dyn Fn() -> bool,
    ) -> Result<ControlFlow<(), Option<Choice>>, Fault> {
        if self.contenders.is_empty() {
            return Ok(ControlFlow::Continue(None));
        }
        let clock = Instant::now();
        let contenders: Vec<Contender> = self.contenders.iter().map(|(c, ..)| c.clone()).collect();
        let horizon = self.spec.horizon();
        let window = match horizon {
            Horizon::Samples(_) => Window::full(self.frame),
            Horizon::Seconds(_) => self.window,
        };
        let view = View::new(self.subject.scene, &self.camera, self.frame, window);
        let chosen = choose_integrator(&contenders, &view, horizon, go_on);
        let chosen = chosen.map_err(|e| Fault::option(self.spec.window_option(), e))?;
        let Some(mut chosen) = chosen else {
            return Ok(ControlFlow::Break(()));
        };
        if let (Horizon::Seconds(_), Some(time)) = (horizon, self.spec.time) {
            let left = left_after(time, clock.elapsed());
            let fits = with_a_first_sample(chosen, &contenders, &view, left);
            chosen = fits.map_err(|e| Fault::option(self.spec.window_option(), e))?;
        }
        self.take(chosen.best);
        self.check_memory()?;
        Ok(ControlFlow::Continue(Some(chosen)))
    }

    /// Chooses the integrator, if it is open, and prepares the picture. `None` if `go_on`, which is called before every
    /// small render, returns false.
    pub fn begin(&mut self, go_on: &dyn Fn() -> bool) -> Result<Option<PreparedRender>, Fault> {
        let clock = Instant::now();
        let ControlFlow::Continue(choice) = self.choose(go_on)? else {
            return Ok(None);
        };
        let pilot = if choice.is_some() {
            clock.elapsed()
        } else {
            Duration::ZERO
        };
        let (picture, start, spent) = match self.old.take() {
            Some(old) => (old.picture, old.samples, old.seconds),
            None => {
                let amounts = &self.settings.amounts;
                let blank =
                    Picture::blank(self.frame, self.window, amounts, self.spec.recorded_aovs());
                (
                    blank.map_err(|e| Fault::option(self.spec.window_option(), e))?,
                    0,
                    0.0,
                )
            }
        };
        Ok(Some(PreparedRender {
            picture,
            start,
            spent,
            pilot,
            choice,
        }))
    }

    /// Renders until the budget is spent or the callback breaks.
    ///
    /// Setting `stop_flag` ends the render between tiles or chains.
    pub fn render(
        &self,
        begun: PreparedRender,
        stop_flag: Option<&AtomicBool>,
        on_pass: OnPass<'_>,
    ) -> Output {
        let mut picture = begun.picture;
        let mut integrator = self.settings.integrator();
        let (mut view, budget) = (self.view(), self.spec.budget(begun.pilot));
        let ends = stop_flag.map(Stop::when);
        if let Some(ends) = &ends {
            view = view.until(ends);
        }
        let (progress, reason) = drive(
            &mut *integrator,
            &view,
            &budget,
            begun.start,
            &mut picture,
            on_pass,
        );
        let missing = missing_light(&view, &self.settings, &picture, progress.samples);
        Output {
            picture,
            progress,
            reason,
            missing,
        }
    }

    /// Names and values of the method's options, the integrator first: the user's, or a pilot's choice.
    pub fn method_options(&self) -> Vec<(&'static str, String)> {
        let of_method = |(option, _): &(&Opt, String)| {
            matches!(option.heading, Heading::Method | Heading::Research)
        };
        let given = self.own.given().filter(of_method);
        let others = given.filter(|(option, _)| option.name != "integrator");
        let mut options = vec![("integrator", word(&self.kind))];
        options.extend(others.map(|(option, text)| (option.name, text)));
        options
    }

    /// The options behind the settings: the user's, or those of the contender that a pilot chose.
    pub(super) fn own(&self) -> &Spec {
        &self.own
    }

    /// The identity of this render, stored in its checkpoints.
    pub(crate) fn fingerprint(&self) -> Fingerprint {
        self.identity(&self.settings, true)
    }

    /// The identity of a render with these settings; without `cropped` it is the same for all crops.
    pub(super) fn identity(&self, settings: &Settings, cropped: bool) -> Fingerprint {
        let crop = self.spec.crop.filter(|_| cropped).map(|_| self.window);
        let scene = self.spec.words(&[Heading::Scene, Heading::Light]);
        let Recorded { first, light, time } = self.spec.recorded_aovs();
        let settings = format!(
            "{}, {}x{}, crop {crop:?}, camera {:?} {:?}, aov {:?}{scene}",
            settings.fingerprint(),
            self.frame.x,
            self.frame.y,
            self.camera.name,
            self.camera.lens,
            [first, light, time],
        );
        Fingerprint {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: self.subject.sha256.to_owned(),
            settings,
        }
    }
}

impl Spec {
    /// The option that an invalid film is blamed on.
    fn window_option(&self) -> &'static str {
        if self.crop.is_some() { "crop" } else { "size" }
    }
}
