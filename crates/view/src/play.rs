//! Playback of animations: all frames of the film at a few samples, in the order of the clock, and then rounds of
//! better frames, averaged along the surfaces that they share.

use super::film::{self, Film, StoredFrame};
use super::open_scene::{OpenScene, path_settings};
use super::options::Options;
use super::preview::{COST, LAST_SCALE, MAX_SCALE, settings};
use super::work::{Renderer, first_look, prepared};
use opsr::image::film::Window;
use opsr::integrator::{Picture, Recorded, Stop, View};
use opsr::math::UVec2;
use opsr::render::open::Opened;
use opsr::render::value::Moment;
use opsr::render::{Fault, Shown, Spec, Subject};
use opsr::scene::Hit;
use opsr_formats::FORMATS;
use opsr_frames::surfaces::places;
use opsr_frames::{Averaged, Frame, Sequence, Surfaces};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Edge of a pixel in pixels of the frame, and samples, of the frames of each round after the first.
const ROUNDS: [(u32, u32); 3] = [(LAST_SCALE, 4), (1, 8), (1, 32)];

/// Samples of the first frames, and seconds that one may take.
const FIRST_SAMPLES: u32 = 2;
const FIRST: f64 = 0.1;

/// Metadata key of a frame's command.
const COMMAND: &str = "command";

/// The scene of the last frame with the hits at its pixels' centres, and frames that wait for their neighbours.
#[derive(Default)]
struct FrameBuffer {
    last: Option<(Opened, Vec<Option<Hit>>)>,
    sequence: Sequence,
}

impl FrameBuffer {
    /// The scene at the moment of a spec; the scene of the last frame if only cameras have moved since.
    fn open(&mut self, spec: &Spec, path: &Path) -> Result<Opened, Fault> {
        if let Some((opened, _)) = &mut self.last
            && opened.at(spec, path, FORMATS)?
            && let Some((opened, _)) = self.last.take()
        {
            return Ok(opened);
        }
        spec.open(path, FORMATS, opsr::scene::Scene::new)
    }

    /// Adds a frame of a scene; gives the frame that has all of its neighbours now.
    fn push(&mut self, opened: Opened, mut frame: Frame) -> Option<(&Frame, Averaged)> {
        let view = View::new(&opened.scene, &frame.camera, frame.size, frame.window);
        let (surfaces, hits) = Surfaces::of(&view);
        frame.surfaces = surfaces;
        if let Some((last, before)) = &self.last {
            let after = places(before, &last.scene, &opened.scene);
            self.sequence.set_after(after);
            frame.surfaces.before = places(&hits, &opened.scene, &last.scene);
        }
        self.last = Some((opened, hits));
        // Never an error: all frames of a round have one size.
        self.sequence.push(frame).ok().flatten()
    }
}

impl Renderer<'_> {
    /// Renders frames of the film, and better ones in every round, until something changes.
    pub(super) fn play(&mut self, options: &Options, open_scene: &OpenScene) -> Result<(), Fault> {
        let hub = self.hub;
        let frame = options.spec.frame(&open_scene.opened.scene)?;
        let (count, rate) = film::pace(open_scene.seconds());
        let least = hub.change(|state| {
            let key = options.film_key();
            state.run += 1;
            if state.film.as_ref().is_none_or(|film| film.key != key) {
                let in_studio = open_scene.opened.in_studio;
                state.film = Some(Film::new(state.run, key, (count, rate), frame, in_studio));
            }
            state.progress = Default::default();
            (state.fault, state.missing, state.flip) = (None, None, None);
            state.phase = "playing";
            // Files show a moment at rest: pages that wait for one get none.
            state.saves.clear();
            state.status_version += 1;
            state.film.as_ref().map_or(1, |film| film.scale)
        });
        let mut buf = FrameBuffer::default();
        let mut took = 0.0;
        let first = self.first_scale(frame).max(least);
        // The next frame is the first that the clock has not reached by the time at which it is ready.
        while let Some(number) = self.film(|film| {
            let now = options.playing.map_or(0.0, |clock| clock.seconds());
            film.first_missing(now + took)
        }) {
            let clock = Instant::now();
            let made = self.frame(options, &mut buf, (number, rate), (first, FIRST_SAMPLES))?;
            let Some((opened, frame)) = made else {
                return Ok(());
            };
            buf.last = Some((opened, Vec::new()));
            self.keep(&frame, frame.picture.clone(), 0, FIRST_SAMPLES);
            took = clock.elapsed().as_secs_f64();
        }
        for (round, (scale, samples)) in (1..).zip(ROUNDS) {
            let Some(from) = self.film(|film| film.first_before(round)) else {
                continue;
            };
            let mut buf = FrameBuffer::default();
            for number in from..count {
                let how = (scale.max(least), samples);
                let Some((opened, frame)) = self.frame(options, &mut buf, (number, rate), how)?
                else {
                    return Ok(());
                };
                if let Some((frame, averaged)) = buf.push(opened, frame) {
                    self.keep(frame, averaged.picture, round, samples);
                }
            }
            while let Some((frame, averaged)) = buf.sequence.average_next() {
                self.keep(frame, averaged.picture, round, samples);
            }
        }
        while !hub.obsolete.load(Ordering::Relaxed) {
            let number = hub.lock().options_number;
            drop(hub.wait(Duration::from_secs(1), |state| {
                state.options_number != number
            }));
        }
        Ok(())
    }

    /// Calls `ask` with the film, if there is one.
    fn film<T>(&self, ask: impl FnOnce(&Film) -> Option<T>) -> Option<T> {
        self.hub.lock().film.as_ref().and_then(ask)
    }

    /// Edge of a pixel, in pixels of the frame, with which a frame takes at most about [`FIRST`] seconds.
    fn first_scale(&self, frame: UVec2) -> u32 {
        let cost = self.previews.cost.map_or(COST, |(_, cost)| cost);
        let pixels = frame.as_dvec2().element_product();
        let quick = |scale: &u32| cost * pixels / f64::from(scale * scale) <= FIRST;
        (1..MAX_SCALE).find(quick).unwrap_or(MAX_SCALE)
    }

    /// Keeps the picture of a frame.
    fn keep(&self, frame: &Frame, picture: opsr::image::Buffer, round: usize, samples: u32) {
        let still = StoredFrame {
            picture,
            round,
            samples,
            command: frame.metadata.get(COMMAND).cloned().unwrap_or_default(),
        };
        self.hub.change(|state| {
            if let Some(film) = &mut state.film {
                film.store(frame.number as usize, still);
            }
            state.status_version += 1;
        });
    }

    /// Renders a frame with this edge of its pixels and these samples, without tracing its surfaces; `None` if
    /// something changed meanwhile.
    fn frame(
        &mut self,
        options: &Options,
        buf: &mut FrameBuffer,
        (number, rate): (usize, f64),
        (scale, samples): (u32, u32),
    ) -> Result<Option<(Opened, Frame)>, Fault> {
        let hub = self.hub;
        let mut spec = options.spec.clone();
        spec.at = Some(Moment::Frame(number as f64, rate));
        // Equal noise in all frames would not average out.
        spec.seed = Some(spec.seed.unwrap_or_default().wrapping_add(number as u64));
        let file = &options.file;
        let opened = buf.open(&spec, &file.path);
        let opened = opened.map_err(|fault| file.redacted(fault))?;
        let subject = Subject {
            scene: &opened.scene,
            name: &file.name,
            sha256: &opened.sha256,
            in_studio: opened.in_studio,
        };
        let look = match options.look_in(&opened.scene) {
            Some(look) => look,
            None => first_look(&spec, &opened.scene)?,
        };
        let (mut request, _) = prepared(&spec, look, subject)?;
        self.take_choice(&mut request);
        let denoiser = request.spec.denoiser()?;
        let settings = settings(&request, &path_settings(&request.settings));
        let size = (request.frame / scale).max(UVec2::ONE);
        let window = Window::full(size);
        let stop = Stop::when(&hub.obsolete);
        let view = View::new(&opened.scene, &request.camera, size, window);
        let recorded = Recorded {
            first: denoiser.is_some(),
            ..Recorded::default()
        };
        let blank = Picture::blank(size, window, &settings.amounts, recorded);
        let mut picture = blank.map_err(|e| Fault::option("size", e))?;
        let added = settings
            .integrator()
            .pass(&view.until(&stop), 0..samples, &mut picture);
        if added < samples || hub.obsolete.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let shown = Shown::of(&picture, &request.spec, denoiser.as_ref())?;
        let known = shown.resolved.as_ref().filter(|r| r.is_known());
        let frame = Frame {
            number: number as u32,
            size,
            window,
            camera: request.camera.clone(),
            error: shown.errors(&picture.film, None).unwrap_or_default(),
            squares: known.map_or(Vec::new(), |resolved| resolved.squares().collect()),
            surfaces: Surfaces::default(),
            layers: Vec::new(),
            metadata: [(COMMAND.to_owned(), request.command())].into(),
            picture: shown.picture,
        };
        Ok(Some((opened, frame)))
    }
}
