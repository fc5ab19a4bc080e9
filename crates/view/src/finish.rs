//! From a film to the picture that is shown: the choice among levels, errors, the denoiser. A separate thread and pool
//! do this, so that previews never wait for it. Of the waiting films only the newest is kept.

use super::hub::{Hub, Snapshot};
use super::likeness::likeness;
use super::open_scene::Viewpoint;
use super::options::{Other, Overlay};
use opsr::image::Buffer;
use opsr::image::film::Film;
use opsr::integrator::{Picture, Settings, Stop};
use opsr::pilot::witness::{MissingLight, missing_light};
use opsr::render::{Fault, Names, Shown, Spec};
use opsr_metric::flip;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A film to be finished.
pub(super) struct Job {
    pub(super) side: usize,
    pub(super) run: u64,
    pub(super) viewpoint: Arc<Viewpoint>,
    pub(super) settings: Settings,
    pub(super) picture: Picture,
    pub(super) samples: u32,
    pub(super) seconds: f64,
    /// Set once its render has ended.
    pub(super) over: Arc<AtomicBool>,
}

/// The waiting films, at most one for each side.
#[derive(Default)]
pub(super) struct Slot {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    jobs: [Option<Job>; 2],
    busy: bool,
    /// Seconds that the last film took.
    cost: f64,
}

impl Slot {
    /// Replaces the waiting film of a side.
    pub(super) fn offer(&self, job: Job) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let side = job.side;
        waiting.jobs[side] = Some(job);
        drop(waiting);
        self.changed.notify_all();
    }

    /// Seconds that the last film took; `None` while a film waits or is in work.
    pub(super) fn cost(&self) -> Option<f64> {
        let waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let busy = waiting.busy || waiting.jobs.iter().any(Option::is_some);
        (!busy).then_some(waiting.cost)
    }

    /// The next film, of the first side first; `None` if none comes for 0.2 s.
    pub(super) fn take(&self) -> Option<Job> {
        let waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut waiting, _) = self
            .changed
            .wait_timeout_while(waiting, Duration::from_millis(200), |w| {
                w.jobs.iter().all(Option::is_none)
            })
            .unwrap_or_else(PoisonError::into_inner);
        let [first, other] = &mut waiting.jobs;
        let job = first.take().or_else(|| other.take());
        waiting.busy = job.is_some();
        job
    }

    /// Ends the work on a film, which took these seconds.
    pub(super) fn done(&self, cost: f64) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        (waiting.busy, waiting.cost) = (false, cost);
    }
}

/// Finishes films until the viewer ends.
pub(super) fn run(hub: &Hub, slot: &Slot, pool: &rayon::ThreadPool) {
    let mut witness = Witness::default();
    while !hub.ended() {
        let Some(job) = slot.take() else { continue };
        let clock = Instant::now();
        let comparison = Comparison::of(hub, &job);
        let Some((spec, comparison)) = comparison else {
            slot.done(clock.elapsed().as_secs_f64());
            continue;
        };
        let (side, run) = (job.side, job.run);
        let due = side == 0 && witness.is_due(&job, &spec);
        let missing = (side == 0).then(|| witness.of(run)).flatten();
        let made = pool.install(|| finished(&job, &spec, &comparison, missing));
        match made {
            Ok(snapshot) => hub.show(side, snapshot),
            Err(fault) => hub.change(|state| {
                state.notes = vec![fault.message(Names::Flags)];
                state.status_version += 1;
            }),
        }
        // The picture is shown before the witness runs, which is not part of this cost.
        let cost = clock.elapsed().as_secs_f64();
        if due && pool.install(|| witness.look(&job)) {
            let words = witness.of(run).map(ToString::to_string);
            hub.change(|state| {
                if state.run == run {
                    state.missing = words;
                    state.status_version += 1;
                }
            });
            // The missing light is part of the error and of its map.
            if let Some(missing) = witness.of(run)
                && let Ok(snapshot) =
                    pool.install(|| finished(&job, &spec, &comparison, Some(missing)))
            {
                hub.show(side, snapshot);
            }
        }
        slot.done(cost);
    }
}

/// The picture that a film is compared with, and the kind of comparison.
struct Comparison {
    picture: Option<Arc<Snapshot>>,
    /// The reference, which replaces that picture.
    reference: Option<Arc<Buffer>>,
    /// True if FLIP of every pixel is shown.
    shown: bool,
}

impl Comparison {
    /// The comparison of a job, with the current options; `None` if its render is obsolete.
    fn of(hub: &Hub, job: &Job) -> Option<(Spec, Self)> {
        let state = hub.lock();
        if job.run != state.run {
            return None;
        }
        let side = match job.side {
            0 => &state.other,
            _ => &state.shown,
        };
        let whole = |picture: &&Arc<Snapshot>| picture.run == job.run && !picture.preview;
        let reference = state.options.other == Some(Other::Reference);
        let comparison = Self {
            picture: side.as_ref().filter(whole).cloned(),
            reference: hub.reference.clone().filter(|_| reference),
            shown: state.options.overlay == Overlay::Flip,
        };
        Some((state.options.spec.clone(), comparison))
    }

    /// Mean FLIP, and FLIP of every pixel if it is shown.
    fn flip(&self, side: usize, picture: &Buffer) -> (Option<f64>, Option<Vec<f32>>) {
        let of_other = self.picture.as_ref().map(|shown| &shown.picture);
        let Some(other) = self.reference.as_deref().or(of_other) else {
            return (None, None);
        };
        match (self.shown, side) {
            (true, 0) => flip::hdr(picture, other, flip::DEFAULT_PPD)
                .map_or((None, None), |(map, _)| (Some(map.mean), Some(map.values))),
            (true, _) => (None, None),
            (false, 0) => (likeness(picture, other), None),
            (false, _) => (likeness(other, picture), None),
        }
    }
}

/// Light that a render misses, measured at every doubling of the samples and at the end.
#[derive(Default)]
struct Witness {
    run: u64,
    samples: u32,
    found: Option<MissingLight>,
}

impl Witness {
    fn is_due(&self, job: &Job, spec: &Spec) -> bool {
        const FIRST: u32 = 32;
        let new = self.run != job.run || self.samples < job.samples;
        if new && job.samples >= FIRST && spec.spp == Some(job.samples) {
            return true;
        }
        let next = if self.run == job.run {
            2 * self.samples
        } else {
            FIRST
        };
        job.samples >= next.max(FIRST)
    }

    /// Missing light of this render, if any is known.
    fn of(&self, run: u64) -> Option<&MissingLight> {
        self.found.as_ref().filter(|_| self.run == run)
    }

    /// Measures the missing light of a film; false if its render ended meanwhile.
    fn look(&mut self, job: &Job) -> bool {
        let stop = Stop::when(&job.over);
        let view = job.viewpoint.view(job.viewpoint.frame).until(&stop);
        let found = missing_light(&view, &job.settings, &job.picture, job.samples);
        if job.over.load(Ordering::Relaxed) {
            return false;
        }
        (self.run, self.samples, self.found) = (job.run, job.samples, found);
        true
    }
}

/// Maps of the pixels of a film.
#[derive(Default)]
pub(super) struct Maps {
    /// Expected relative error, its noise, and for several levels its bias.
    pub(super) error: Option<Vec<f32>>,
    pub(super) noise: Option<Vec<f32>>,
    pub(super) bias: Option<Vec<f32>>,
    /// Chosen level.
    pub(super) level: Option<Vec<u8>>,
    /// Lower bound of the share of light that is missing.
    pub(super) missing: Option<Vec<f32>>,
    /// FLIP against the other picture.
    pub(super) flip: Option<Vec<f32>>,
    /// Stated error of the whole.
    pub(super) stated: Option<f64>,
}

/// The picture of a film, by the code that writes files.
fn finished(
    job: &Job,
    spec: &Spec,
    comparison: &Comparison,
    missing: Option<&MissingLight>,
) -> Result<Snapshot, Fault> {
    let denoiser = spec.denoiser()?;
    let shown = Shown::of(&job.picture, spec, denoiser.as_ref())?;
    let mut maps = Maps::of(&shown, &job.picture.film, missing);
    let picture = shown.picture;
    let (flip, values) = comparison.flip(job.side, &picture);
    maps.flip = values;
    Ok(Snapshot {
        viewpoint: job.viewpoint.clone(),
        run: job.run,
        preview: false,
        samples: job.samples,
        seconds: job.seconds,
        size: job.picture.film.size,
        picture,
        maps,
        flip,
    })
}

impl Maps {
    fn of(shown: &Shown, film: &Film, missing: Option<&MissingLight>) -> Self {
        let error = shown.errors(film, missing);
        let Some(error) = error else {
            return Self::default();
        };
        let root = |squares: &[f32]| squares.iter().map(|x| x.sqrt()).collect();
        let (noise, bias, level) = match &shown.resolved {
            Some(resolved) => (
                Some(root(&resolved.variance)),
                Some(root(&resolved.bias2)),
                Some(resolved.level.clone()),
            ),
            None => (shown.errors(film, None), None, None),
        };
        Self {
            error: Some(error),
            noise,
            bias,
            level,
            missing: missing.map(|missing| root(&missing.squares)),
            flip: None,
            stated: Some(shown.statement(film, missing).mean),
        }
    }
}

#[cfg(test)]
mod tests;
