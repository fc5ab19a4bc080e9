//! State that the threads of a viewer share: the newest options and pictures, bounded in size.

use super::film::Film;
use super::finish::Maps;
use super::open_scene::{OpenScene, Viewpoint};
use super::options::Options;
use opsr::image::Buffer;
use opsr::math::UVec2;
use opsr::render::{Fault, Names, Outcome};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum points of a curve, and maximum pages that wait for a file.
const MAX_POINTS: usize = 256;
const MAX_SAVES: usize = 4;

/// A picture that is shown, in linear radiance, with its maps.
pub(super) struct Snapshot {
    pub(super) viewpoint: Arc<Viewpoint>,
    /// Number of its render.
    pub(super) run: u64,
    /// True for a picture of fewer pixels than the frame.
    pub(super) preview: bool,
    pub(super) samples: u32,
    /// Seconds of its render.
    pub(super) seconds: f64,
    pub(super) size: UVec2,
    pub(super) picture: Buffer,
    pub(super) maps: Maps,
    /// Mean FLIP against the other picture.
    pub(super) flip: Option<f64>,
}

/// Pixels for a page: rows from the top, RGBA with one byte per channel.
#[derive(Clone)]
pub(super) struct Painted {
    pub(super) size: UVec2,
    pub(super) bytes: Arc<[u8]>,
}

/// A frame for pages.
#[derive(Clone)]
pub(super) struct Frame {
    pub(super) head: Value,
    pub(super) picture: Painted,
    pub(super) other: Option<Painted>,
}

/// Progress of a render.
#[derive(Clone, Default)]
pub(super) struct Progress {
    pub(super) samples: u32,
    pub(super) seconds: f64,
    /// (seconds, samples, stated error).
    points: Vec<(f64, u32, f64)>,
}

impl Progress {
    /// Adds a point; drops every second point first where there are too many.
    fn add(&mut self, seconds: f64, samples: u32, error: f64) {
        if !error.is_finite() || samples == 0 {
            return;
        }
        if self.points.len() >= MAX_POINTS {
            let mut even = false;
            self.points.retain(|_| {
                even = !even;
                even
            });
        }
        self.points.push((seconds, samples, error));
    }

    fn json(&self) -> Value {
        let points: Vec<Value> = (self.points.iter())
            .map(|(seconds, samples, error)| json!([seconds, samples, error]))
            .collect();
        json!({ "samples": self.samples, "seconds": self.seconds, "curve": points })
    }
}

/// The shared state.
pub(super) struct State {
    pub(super) options: Options,
    /// Numbers of the last changes of options, pictures, frame and words.
    pub(super) options_number: u64,
    pub(super) shown_number: u64,
    pub(super) frame_number: u64,
    pub(super) status_version: u64,
    pub(super) open_scene: Option<Arc<OpenScene>>,
    /// Frames of the animations, once they have been played.
    pub(super) film: Option<Film>,
    pub(super) shown: Option<Arc<Snapshot>>,
    pub(super) other: Option<Arc<Snapshot>>,
    pub(super) frame: Option<Arc<Frame>>,
    pub(super) progress: [Progress; 2],
    /// Number of the render.
    pub(super) run: u64,
    pub(super) phase: &'static str,
    pub(super) integrator: String,
    pub(super) notes: Vec<String>,
    /// Description of the light that the picture misses.
    pub(super) missing: Option<String>,
    /// Mean FLIP of the two pictures.
    pub(super) flip: Option<f64>,
    pub(super) fault: Option<String>,
    pub(super) command: String,
    pub(super) saves: Vec<SyncSender<Outcome<'static>>>,
}

/// The shared state, and the threads that wait for it.
pub(super) struct Hub {
    state: Mutex<State>,
    changed: Condvar,
    /// True if the render in progress is obsolete.
    pub(super) obsolete: AtomicBool,
    ended: AtomicBool,
    /// Picture of the reference.
    pub(super) reference: Option<Arc<Buffer>>,
}

impl Hub {
    pub(super) fn new(options: Options, reference: Option<Buffer>) -> Self {
        Self {
            state: Mutex::new(State {
                options,
                options_number: 1,
                shown_number: 0,
                frame_number: 0,
                status_version: 1,
                open_scene: None,
                film: None,
                shown: None,
                other: None,
                frame: None,
                progress: Default::default(),
                run: 0,
                phase: "loading",
                integrator: String::new(),
                notes: Vec::new(),
                missing: None,
                flip: None,
                fault: None,
                command: String::new(),
                saves: Vec::new(),
            }),
            changed: Condvar::new(),
            obsolete: AtomicBool::new(false),
            ended: AtomicBool::new(false),
            reference: reference.map(Arc::new),
        }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state and wakes all waiting threads.
    pub(super) fn change<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let changed = change(&mut self.lock());
        self.changed.notify_all();
        changed
    }

    /// Waits until the condition holds, the viewer ends, or `most` has passed.
    pub(super) fn wait(
        &self,
        most: Duration,
        holds: impl Fn(&State) -> bool,
    ) -> MutexGuard<'_, State> {
        let waits = |state: &mut State| !self.ended() && !holds(state);
        let waited = self.changed.wait_timeout_while(self.lock(), most, waits);
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    pub(super) fn ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Ends all threads.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
        self.obsolete.store(true, Ordering::Relaxed);
        self.change(|_| ());
    }

    /// Replaces the options.
    pub(super) fn update(
        &self,
        make: impl FnOnce(&Options) -> Result<Options, Fault>,
    ) -> Result<(), Fault> {
        self.change(|state| {
            let next = make(&state.options)?;
            if next.render_key() != state.options.render_key() {
                self.obsolete.store(true, Ordering::Relaxed);
            }
            if next.display_key() != state.options.display_key()
                && let Some(film) = &mut state.film
            {
                film.repaint();
            }
            state.options = next;
            state.options_number += 1;
            state.status_version += 1;
            state.fault = None;
            Ok(())
        })
    }

    /// Shows a fault on the page, with the option names of the command line.
    pub(super) fn fail(&self, fault: &Fault) {
        self.change(|state| {
            state.fault = Some(fault.message(Names::Flags));
            state.phase = "stopped";
            // There will be no picture to save.
            state.saves.clear();
            state.status_version += 1;
        });
    }

    /// Shows a picture on the first or the other side; drops a picture of an older render.
    pub(super) fn show(&self, side: usize, snapshot: Snapshot) {
        self.change(|state| {
            if snapshot.run != state.run {
                return;
            }
            if !snapshot.preview {
                let course = &mut state.progress[side];
                let stated = snapshot.maps.stated.unwrap_or(f64::INFINITY);
                course.add(snapshot.seconds, snapshot.samples, stated);
            }
            state.flip = snapshot.flip.or(state.flip);
            let place = match side {
                0 => &mut state.shown,
                _ => &mut state.other,
            };
            *place = Some(Arc::new(snapshot));
            state.shown_number += 1;
            state.status_version += 1;
        });
    }

    /// Waits for the current render; `None` if there is none, too many pages wait, or two minutes have passed.
    pub(super) fn request_film(&self) -> Option<Outcome<'static>> {
        let (send, receive) = std::sync::mpsc::sync_channel(1);
        let room = self.change(|state| {
            let none =
                state.run == 0 || state.phase == "stopped" || state.options.playing.is_some();
            let room = state.saves.len() < MAX_SAVES && !none;
            if room {
                state.saves.push(send);
            }
            room
        });
        room.then(|| receive.recv_timeout(Duration::from_secs(120)).ok())?
    }
}

impl State {
    /// Everything that a page shows beside pixels.
    pub(super) fn status_json(&self) -> Value {
        let options = &self.options;
        let shown = self.shown.as_ref();
        let mut notes = [options.left_out.as_slice(), self.notes.as_slice()].concat();
        if options.file.is_dropped() {
            let name = &options.file.name;
            notes.push(format!(
                "{name} was dropped onto a page: put its own path into the command"
            ));
        }
        let warnings = self
            .open_scene
            .as_ref()
            .map(|open_scene| &open_scene.opened.warnings);
        json!({
            "phase": self.phase,
            "run": self.run,
            "options": options.spec.settings(),
            "look": options.look,
            "overlay": options.overlay.name(),
            "other": match &options.other {
                None => Value::Null,
                Some(other) => match other {
                    super::options::Other::Reference => "reference".into(),
                    super::options::Other::Plain => "plain".into(),
                    super::options::Other::Integrator(name) => json!({ "integrator": name }),
                },
            },
            "paused": options.paused,
            "scene": self.open_scene.as_ref().map(|_| options.file.path.display().to_string()),
            "film": self.film.as_ref().map(|film| film.json(options.playing)),
            "playing": options.playing.is_some(),
            "integrator": self.integrator,
            "notes": notes,
            "missing": self.missing,
            "warnings": warnings,
            "fault": self.fault,
            "command": self.command,
            "course": self.progress[0].json(),
            "other_course": self.progress[1].json(),
            "error": shown.filter(|s| !s.preview).and_then(|s| s.maps.stated).filter(|e| e.is_finite()),
            "flip": self.flip,
        })
    }
}
