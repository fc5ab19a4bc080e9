//! From a film to the picture that is shown: the choice among levels, errors, the denoiser. A thread of its own with a pool of
//! its own, so that a camera that turns never waits for it; of the films that wait only the newest is kept.

use super::hub::{Hub, Snapshot};
use super::stage::Shot;
use super::wish::{Other, Overlay};
use crate::image::Buffer;
use crate::image::denoise::Denoiser;
use crate::image::film::Film;
use crate::image::metric::flip;
use crate::integrator::{Picture, Settings};
use crate::pilot::witness::missing_light;
use crate::render::files::finish;
use crate::render::{Fault, Names, Spec};
use crate::resolve::{Resolved, film_errors};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A film to be finished.
pub(super) struct Job {
    pub(super) side: usize,
    pub(super) run: u64,
    pub(super) shot: Arc<Shot>,
    pub(super) settings: Settings,
    pub(super) picture: Picture,
    pub(super) samples: u32,
    pub(super) seconds: f64,
}

/// The film that waits, one for each side.
#[derive(Default)]
pub(super) struct Slot {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    jobs: [Option<Job>; 2],
    busy: bool,
    /// Seconds that the last one took.
    cost: f64,
}

impl Slot {
    /// Takes a film in place of the one that waits.
    pub(super) fn offer(&self, job: Job) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let side = job.side;
        waiting.jobs[side] = Some(job);
        drop(waiting);
        self.changed.notify_all();
    }

    /// Seconds that the last film took; `None` while one is worked at.
    pub(super) fn cost(&self) -> Option<f64> {
        let waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let busy = waiting.busy || waiting.jobs.iter().any(Option::is_some);
        (!busy).then_some(waiting.cost)
    }

    fn take(&self) -> Option<Job> {
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

    fn done(&self, cost: f64) {
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
        let state = hub.lock();
        let (spec, current) = (state.wish.spec.clone(), state.run);
        let wanted = state.wish.overlay == Overlay::Flip && job.side == 0;
        let against = match state.wish.other {
            Some(Other::Reference) if job.side == 0 => hub.reference.clone(),
            Some(_) if wanted => state.other.as_ref().map(|s| s.picture.clone()),
            _ => None,
        };
        drop(state);
        if job.run == current {
            let side = job.side;
            if side == 0 && witness.is_due(&job) {
                let missing = pool.install(|| witness.look(&job));
                hub.change(|state| state.missing = missing.filter(|_| state.run == job.run));
            }
            match pool.install(|| finished(job, &spec, against.as_ref())) {
                Ok(snapshot) => hub.show(side, snapshot),
                Err(fault) => hub.change(|state| {
                    state.notes = vec![fault.said(Names::Flags)];
                    state.words_number += 1;
                }),
            }
        }
        slot.done(clock.elapsed().as_secs_f64());
    }
}

/// The next look for light that a render has not met: at every doubling of its samples.
#[derive(Default)]
struct Witness {
    run: u64,
    samples: u32,
}

impl Witness {
    fn is_due(&self, job: &Job) -> bool {
        const FIRST: u32 = 32;
        let next = if self.run == job.run {
            2 * self.samples
        } else {
            FIRST
        };
        job.samples >= next.max(FIRST)
    }

    fn look(&mut self, job: &Job) -> Option<String> {
        (self.run, self.samples) = (job.run, job.samples);
        let view = job.shot.view(job.shot.frame);
        let missing = missing_light(&view, &job.settings, &job.picture, job.samples);
        missing.map(|missing| missing.to_string())
    }
}

/// What a film says of its pixels.
#[derive(Default)]
pub(super) struct Maps {
    /// Expected relative error, and of several levels its noise and bias.
    pub(super) error: Option<Vec<f32>>,
    pub(super) noise: Option<Vec<f32>>,
    pub(super) bias: Option<Vec<f32>>,
    /// Chosen level.
    pub(super) level: Option<Vec<u8>>,
    /// Stated error of the whole.
    pub(super) stated: Option<f64>,
}

/// The picture of a film, by the code that writes its files.
fn finished(job: Job, spec: &Spec, against: Option<&Buffer>) -> Result<Snapshot, Fault> {
    let denoiser = match spec.denoise == Some(true) {
        true => Some(Denoiser::open()?),
        false => None,
    };
    let finished = finish(&job.picture, spec, denoiser.as_ref())?;
    let maps = match finished.resolved {
        Some(resolved) => of_levels(resolved),
        None => of_film(&job.picture.film),
    };
    let picture = finished.shown;
    let flip = against.and_then(|against| flip::hdr(&picture, against, flip::DEFAULT_PPD).ok());
    Ok(Snapshot {
        shot: job.shot,
        run: job.run,
        preview: false,
        samples: job.samples,
        seconds: job.seconds,
        size: job.picture.film.size,
        picture,
        maps,
        flip: flip.map(|(map, _)| (map.mean, map.values)),
    })
}

fn of_levels(resolved: Resolved) -> Maps {
    if !resolved.variance.iter().all(|v| v.is_finite()) {
        return Maps::default();
    }
    let root = |squares: &[f32]| Some(squares.iter().map(|x| x.sqrt()).collect());
    Maps {
        error: Some(resolved.error()),
        noise: root(&resolved.variance),
        bias: root(&resolved.bias2),
        stated: Some(resolved.relative_error()),
        level: Some(resolved.level),
    }
}

fn of_film(film: &Film) -> Maps {
    let error = film_errors(film);
    // What a film of one level states is the root mean square of its pixels.
    let stated = error.as_ref().map(|errors| {
        let squares = errors.iter().map(|&e| f64::from(e) * f64::from(e));
        (squares.sum::<f64>() / errors.len().max(1) as f64).sqrt()
    });
    Maps {
        noise: error.clone(),
        error,
        stated,
        ..Maps::default()
    }
}
