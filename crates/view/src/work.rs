//! The render thread: opens the scene, shows previews, and refines the whole frame until a page changes its options.

use super::finish::{Job, Slot};
use super::hub::{Hub, Progress, State};
use super::open_scene::{OpenScene, Viewpoint};
use super::options::{Options, Overlay, leave_out};
use super::preview::{LAST_SCALE, Previews};
use opsr::integrator::{Integrator, Picture, Stop};
use opsr::math::{UVec2, Vec2, Vec3};
use opsr::render::look::{CameraChoice, Look};
use opsr::render::value::word;
use opsr::render::{Fault, Heading, Outcome, Request, Spec, Subject};
use opsr::resolve::Resolve;
use opsr::scene::Scene;
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Minimum and maximum seconds of a pass of a whole frame, unless one sample takes longer. Samples of a pixel take less
/// time in one pass than in many; a pass is interrupted once it is obsolete.
const PASS: [f64; 2] = [0.25, 1.0];

/// Maximum samples of a pass, and of a render without a number of samples.
const MAX_PASS: u32 = 16;
const MAX_SAMPLES: u32 = 1 << 16;

/// Share of all threads' time that finishing films may take: in the first [`EARLY_SECONDS`] of a render, and later.
const FINISHING: [f64; 2] = [0.25, 0.1];
const EARLY_SECONDS: f64 = 10.0;

/// Maximum wait for new options after an error.
const ERROR_WAIT: Duration = Duration::from_secs(3600);

/// Minimum seconds between two finished pictures.
const MIN_FINISH_INTERVAL: f64 = 0.2;

/// The renderer of a viewer.
pub(super) struct Renderer<'a> {
    pub(super) hub: &'a Hub,
    pub(super) slot: &'a Slot,
    pub(super) previews: Previews,
    /// Choices of pilots by scene and method, which other cameras share.
    pub(super) choices: HashMap<String, usize>,
}

/// A render in progress.
struct Run<'a> {
    request: Request<'a>,
    integrator: Box<dyn Integrator>,
    picture: Picture,
    samples: u32,
    seconds: f64,
    /// Samples of the next pass.
    length: u32,
    offered: Option<Instant>,
    /// Samples of the film that was offered last.
    shown: u32,
    /// Set when this render ends.
    over: Arc<AtomicBool>,
}

impl Renderer<'_> {
    /// Renders with the newest options until the viewer ends.
    pub(super) fn run(&mut self) {
        let hub = self.hub;
        while !hub.ended() {
            let (options, number) = hub.change(|state| {
                hub.obsolete.store(hub.ended(), Ordering::Relaxed);
                (state.options.clone(), state.options_number)
            });
            if let Err(fault) = self.fulfil(&options) {
                tracing_line(&fault);
                hub.fail(&fault);
                drop(hub.wait(ERROR_WAIT, |state| state.options_number != number));
            }
        }
    }

    /// Renders with these options until they change.
    fn fulfil(&mut self, options: &Options) -> Result<(), Fault> {
        let hub = self.hub;
        let open_scene = self.open_scene(options)?;
        let scene = &open_scene.opened.scene;
        if options.playing.is_some() && !open_scene.opened.animations.is_empty() {
            return self.play(options, &open_scene);
        }
        let subject = Subject {
            scene,
            name: &options.file.name,
            sha256: &open_scene.opened.sha256,
            in_studio: open_scene.opened.in_studio,
        };
        let look = match options.look_in(scene) {
            Some(look) => look,
            None => first_look(&options.spec, scene)?,
        };
        let (mut request, left_out) = prepared(&options.spec, look, subject)?;
        self.take_choice(&mut request);
        let viewpoint = Viewpoint::new(
            open_scene.clone(),
            request.camera.clone(),
            request.frame,
            &request.settings,
        );
        let viewpoint = Arc::new(viewpoint);
        let run = hub.change(|state| {
            state.run += 1;
            state.progress = Default::default();
            // Drops frames that other options made.
            (state.film).take_if(|film| film.key != state.options.film_key());
            // Newer options have a camera of their own.
            if state.options.render_key() == options.render_key() {
                state.options.look = Some(look);
            }
            state.notes = [left_out.clone(), request.notes.clone()].concat();
            (state.fault, state.missing, state.flip) = (None, None, None);
            state.phase = "preview";
            state.integrator = word(&request.kind);
            state.command = request.command();
            state.status_version += 1;
            state.run
        });
        if !self.previews.show(hub, &request, &viewpoint, run, None)? {
            return Ok(());
        }
        let other = match options.other_spec()? {
            Some(spec) => {
                let mut other = prepared(&spec, look, subject)?.0;
                self.take_choice(&mut other);
                Some(other)
            }
            None => None,
        };
        self.refine(request, other, &viewpoint, run)
    }

    /// The open scene, opened again if options of the scene have changed.
    fn open_scene(&mut self, options: &Options) -> Result<Arc<OpenScene>, Fault> {
        let open = self.hub.lock().open_scene.clone();
        if let Some(open_scene) = open.filter(|open| open.key == options.scene_key()) {
            return Ok(open_scene);
        }
        self.hub.change(|state| {
            state.phase = "loading";
            state.status_version += 1;
        });
        let open_scene = Arc::new(OpenScene::of(options)?);
        self.hub
            .change(|state| state.open_scene = Some(open_scene.clone()));
        Ok(open_scene)
    }

    /// Refines a render, and another one beside it for the same time.
    fn refine(
        &mut self,
        request: Request<'_>,
        other: Option<Request<'_>>,
        viewpoint: &Arc<Viewpoint>,
        run: u64,
    ) -> Result<(), Fault> {
        let hub = self.hub;
        let over = Arc::new(AtomicBool::new(false));
        let advised = request.settings.estimator;
        let Some(mut runs) = self.begin(request, other, &over)? else {
            return Ok(());
        };
        let chosen = &runs[0].request;
        let is_new = chosen.settings.estimator != advised;
        if is_new
            && !self
                .previews
                .show(hub, chosen, viewpoint, run, Some(LAST_SCALE))?
        {
            return Ok(());
        }
        let mut showing = showing(&hub.lock());
        while !hub.obsolete.load(Ordering::Relaxed) {
            if runs[0].samples > 0 {
                self.save(&runs[0]);
            }
            let (paused, now) = {
                let state = hub.lock();
                (state.options.paused, self::showing(&state))
            };
            // Options of the finished picture have changed: the film is finished again.
            if now != showing {
                showing = now;
                runs.iter_mut().for_each(|run| run.shown = 0);
            }
            let stated = |side: usize, state: &State| {
                let shown = [&state.shown, &state.other][side].as_ref();
                shown
                    .filter(|s| s.run == run && !s.preview)
                    .and_then(|s| s.maps.stated)
            };
            let next = (0..runs.len())
                // A paused render takes its first sample, so that it can be saved.
                .filter(|&side| !paused || runs[side].samples == 0)
                .filter(|&side| !runs[side].done(stated(side, &hub.lock())))
                .min_by(|&a, &b| runs[a].seconds.total_cmp(&runs[b].seconds));
            let Some(side) = next else {
                self.rest(&mut runs, viewpoint, run, paused);
                continue;
            };
            if !runs[side].step(hub) {
                continue;
            }
            hub.change(|state| {
                let Progress {
                    samples, seconds, ..
                } = &mut state.progress[side];
                (*samples, *seconds) = (runs[side].samples, runs[side].seconds);
                state.phase = "rendering";
                // Pages show the count of every pass.
                state.status_version += 1;
            });
            self.offer(&mut runs[side], side, viewpoint, run, false);
        }
        over.store(true, Ordering::Relaxed);
        // Large films are freed while the next render runs, not before it.
        let films: Vec<Picture> = runs.into_iter().map(|run| run.picture).collect();
        std::thread::spawn(move || drop(films));
        Ok(())
    }

    /// Runs of one request or of two, with no sample yet; `None` if something changed meanwhile.
    fn begin<'r>(
        &mut self,
        request: Request<'r>,
        other: Option<Request<'r>>,
        over: &Arc<AtomicBool>,
    ) -> Result<Option<Vec<Run<'r>>>, Fault> {
        let hub = self.hub;
        let mut runs = Vec::new();
        for mut request in [Some(request), other].into_iter().flatten() {
            hub.change(|state| {
                state.phase = "rendering";
                state.status_version += 1;
            });
            let go_on = || !hub.obsolete.load(Ordering::Relaxed);
            let Some(begun) = request.begin(&go_on)? else {
                return Ok(None);
            };
            if let Some(choice) = begun.choice {
                self.choices.insert(choice_key(&request), choice.best);
            }
            hub.change(|state| {
                if runs.is_empty() {
                    state.integrator = word(&request.kind);
                    state.command = request.command();
                }
                state.status_version += 1;
            });
            runs.push(Run::new(request, begun.picture, over.clone()));
        }
        Ok(Some(runs))
    }

    /// Gives a request the method that a pilot has chosen for the same options.
    pub(super) fn take_choice(&self, request: &mut Request<'_>) {
        if let Some(place) = self.choices.get(&choice_key(request)) {
            request.take(*place);
        }
    }

    /// Offers the newest films, and waits for a change.
    fn rest(&self, runs: &mut [Run<'_>], viewpoint: &Arc<Viewpoint>, run: u64, paused: bool) {
        for (side, one) in runs.iter_mut().enumerate() {
            self.offer(one, side, viewpoint, run, true);
        }
        let phase = if paused { "paused" } else { "done" };
        let number = self.hub.change(|state| {
            if state.phase != phase {
                state.phase = phase;
                state.status_version += 1;
            }
            state.options_number
        });
        let waiting = runs.iter().any(|run| run.shown != run.samples);
        let most = Duration::from_millis(if waiting { 50 } else { 1000 });
        drop(self.hub.wait(most, |state| {
            state.options_number != number || !state.saves.is_empty()
        }));
    }

    /// Hands a film to the finishing thread, if a picture is due.
    fn offer(
        &self,
        run: &mut Run<'_>,
        side: usize,
        viewpoint: &Arc<Viewpoint>,
        number: u64,
        last: bool,
    ) {
        let Some(cost) = self.slot.cost() else {
            return;
        };
        let threads = rayon::current_num_threads() as f64;
        let share = FINISHING[usize::from(run.seconds > EARLY_SECONDS)];
        let every = (cost / (threads * share)).max(MIN_FINISH_INTERVAL);
        let due = run
            .offered
            .is_none_or(|at| at.elapsed().as_secs_f64() >= every);
        let wanted = !self.hub.obsolete.load(Ordering::Relaxed);
        // The last preview has less error than one sample of the whole frame.
        let old_enough = run.samples > 1 && due;
        if run.shown == run.samples || !(old_enough || last) || !wanted {
            return;
        }
        (run.offered, run.shown) = (Some(Instant::now()), run.samples);
        self.slot.offer(Job {
            side,
            run: number,
            viewpoint: viewpoint.clone(),
            settings: run.request.settings.clone(),
            picture: run.picture.clone(),
            samples: run.samples,
            seconds: run.seconds,
            over: run.over.clone(),
        });
    }

    /// Sends the render to the pages that save it.
    fn save(&self, run: &Run<'_>) {
        let (saves, updated) = {
            let mut state = self.hub.lock();
            (std::mem::take(&mut state.saves), state.options.spec.clone())
        };
        // The choice among levels is made again, by the newest options.
        let mut request = run.request.clone();
        request.spec.resolve = updated.resolve;
        for save in saves {
            let picture = Cow::Owned(run.picture.clone());
            let mut outcome = Outcome::of(&request, picture, run.samples, None);
            let command = format!("{} --spp {}", request.command(), run.samples);
            outcome.metadata.insert("command".into(), command);
            // The page may have left.
            let _ = save.try_send(outcome);
        }
    }
}

impl<'a> Run<'a> {
    /// A render without a sample.
    fn new(request: Request<'a>, picture: Picture, over: Arc<AtomicBool>) -> Self {
        Self {
            integrator: request.settings.integrator(),
            picture,
            request,
            samples: 0,
            seconds: 0.0,
            length: 1,
            offered: None,
            shown: 0,
            over,
        }
    }

    /// Adds a pass; false if it added no sample.
    fn step(&mut self, hub: &Hub) -> bool {
        let stop = Stop::when(&hub.obsolete);
        let most = self.request.spec.spp.unwrap_or(MAX_SAMPLES);
        let end = (self.samples + self.length).min(most);
        let clock = Instant::now();
        let view = self.request.view();
        let added =
            (self.integrator).pass(&view.until(&stop), self.samples..end, &mut self.picture);
        let seconds = clock.elapsed().as_secs_f64();
        self.samples += added;
        self.seconds += seconds;
        let each = seconds / f64::from(added.max(1));
        let pass = (0.1 * self.seconds).clamp(PASS[0], PASS[1]);
        let room = (pass / each.max(1e-9)).clamp(1.0, f64::from(MAX_PASS)) as u32;
        self.length = (2 * self.length).min(room);
        added > 0
    }

    /// True if the render has reached the samples, the time or the error of its options.
    fn done(&self, stated: Option<f64>) -> bool {
        let spec = &self.request.spec;
        let enough = self.samples >= spec.spp.unwrap_or(MAX_SAMPLES);
        let late = spec
            .time
            .is_some_and(|time| self.seconds >= time.as_secs_f64());
        let good = (spec.target_error.zip(stated)).is_some_and(|(bound, e)| e <= f64::from(bound));
        enough || late || good && self.samples >= 16
    }
}

/// Options of the finished picture: a change of them finishes the film again.
fn showing(state: &State) -> (Resolve, bool) {
    (
        state.options.spec.resolve(),
        state.options.overlay == Overlay::Flip,
    )
}

/// The request of a spec with a camera, and a message for each option that was left out because others exclude it.
pub(super) fn prepared<'a>(
    spec: &Spec,
    look: Look,
    subject: Subject<'a>,
) -> Result<(Request<'a>, Vec<String>), Fault> {
    let mut spec = Spec {
        camera: None,
        ..spec.clone()
    };
    // The look includes the lens of the file's camera.
    let frame = spec.frame(subject.scene)?;
    let look = Look {
        aspect: Some(frame.x as f32 / frame.y as f32),
        ..look
    };
    spec.camera = Some(CameraChoice::Numbers(Box::new(look)));
    let mut left_out = Vec::new();
    loop {
        match Request::new(&spec, subject, None) {
            Ok(request) => return Ok((request, left_out)),
            Err(fault) => {
                let (without, why) = leave_out(&spec, fault, &[])?;
                spec = without;
                left_out.push(why);
            }
        }
    }
}

/// Key that renders with the same candidates share, with any camera, size and moment.
fn choice_key(request: &Request<'_>) -> String {
    let given = request.spec.given().filter(|(option, _)| {
        let heading = matches!(
            option.heading,
            Heading::Scene | Heading::Light | Heading::Method | Heading::Research
        );
        option.name != "at" && (heading || ["lens", "aov"].contains(&option.name))
    });
    let words = given.map(|(option, text)| format!(", {} {text}", option.name));
    request.subject.sha256.to_owned() + &words.collect::<String>()
}

/// Rays along each side of the picture for the median depth.
const DEPTHS: u32 = 9;

/// The look of the camera that the options name. Its target is at the median depth of the visible surfaces without the
/// studio's floor, or at the depth of the middle of the scene if there are none.
pub(super) fn first_look(spec: &Spec, scene: &Scene) -> Result<Look, Fault> {
    let frame = spec.frame(scene)?;
    let bare = Spec {
        lens: None,
        ..spec.clone()
    };
    let camera = bare.camera(scene, frame)?;
    let along = |p: Vec3| (p - camera.position).dot(-camera.frame.n);
    let floor = scene.parts().floor().map(|mesh| mesh.material);
    let depth = |i: u32| {
        let at = UVec2::new(i % DEPTHS, i / DEPTHS).as_vec2() + Vec2::splat(0.5);
        let ray = camera.ray(at / DEPTHS as f32, frame.x as f32 / frame.y as f32);
        let hit = scene.intersect_seen(&ray)?;
        let is_floor = Some(scene.geometry().triangle_material(hit.triangle)) == floor;
        (!is_floor).then(|| along(ray.origin + hit.t * ray.dir))
    };
    let mut depths: Vec<f32> = (0..DEPTHS * DEPTHS).filter_map(depth).collect();
    depths.sort_by(f32::total_cmp);
    let (low, high) = scene.bounds();
    let distance = (depths.get(depths.len() / 2)).map_or(along(0.5 * (low + high)), |d| *d);
    let least = 1e-3 * (high - low).length().max(f32::MIN_POSITIVE);
    Ok(Look::of(&camera, distance.max(least)))
}

/// Writes a fault to the terminal, too.
fn tracing_line(fault: &Fault) {
    // A failed write is ignored.
    let _ = writeln!(
        std::io::stderr(),
        "opsr: {}",
        fault.message(opsr::render::Names::Flags)
    );
}

#[cfg(test)]
mod tests;
