//! Runs passes until a budget is spent.

use super::{Integrator, Picture, Stop, View};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Bounds of a render, which stops at the first that it reaches; without bounds, the listener must stop it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Budget {
    /// Samples per pixel in all, those of a resumed film included.
    pub samples: Option<u32>,
    /// Wall time of this run.
    pub time: Option<Duration>,
    /// Estimated relative error of the picture.
    pub error: Option<ErrorBound>,
}

/// Bound of an estimated error.
#[derive(Clone, Copy, Debug)]
pub struct ErrorBound {
    /// The render stops at this error.
    pub bound: f64,
    /// Estimates a picture's relative error, with an allowance for the uncertainty of the estimate.
    pub estimate: fn(&Picture) -> f64,
}

/// The bound that ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// All samples are complete.
    Samples,
    /// The time limit was reached.
    Time,
    /// The estimated error reached its bound.
    Error,
    /// The listener returned a break, or a stop was requested.
    Stopped,
}

/// State of a render after a pass.
#[derive(Clone, Copy, Debug)]
pub struct RenderProgress {
    /// Samples per pixel so far.
    pub samples: u32,
    /// Wall time of this run so far.
    pub elapsed: Duration,
    /// Part of the budget that is spent, in [0, 1]; `None` without a budget.
    pub fraction: Option<f64>,
    /// Latest estimate of the relative error; only for a budget with an error bound.
    pub error: Option<f64>,
}

/// Least samples for a stop by error: fewer samples estimate their own noise too badly.
const MIN_SAMPLES_FOR_ERROR: u32 = 16;

/// Schedule of the estimates of a picture's error, each of which costs as much as some samples. The number of samples
/// grows by a quarter between estimates. An estimate is skipped if, by the one before, the bound cannot be reached yet.
struct Estimates {
    limit: Option<ErrorBound>,
    /// Samples at the next estimate.
    next: u32,
    /// The latest estimate, after its samples.
    latest: Option<(u32, f64)>,
}

impl Estimates {
    /// Least factor of the error while the samples grow by n, times √n: 1 for noise, less for the allowance.
    const MIN_FALL: f64 = 0.8;

    /// For a picture that has this many samples.
    fn new(limit: Option<ErrorBound>, samples: u32) -> Self {
        let mut next = if limit.is_some() {
            MIN_SAMPLES_FOR_ERROR
        } else {
            u32::MAX
        };
        while next < samples {
            next = Self::beyond(next);
        }
        Self {
            limit,
            next,
            latest: None,
        }
    }

    fn beyond(samples: u32) -> u32 {
        samples.saturating_add(samples / 4)
    }

    /// Estimates the error of a picture with this many samples, if an estimate is due.
    fn look(&mut self, samples: u32, picture: &Picture) {
        if let Some(limit) = self.limit.filter(|_| samples == self.next) {
            let error = (limit.estimate)(picture);
            let fall = |next: u32| Self::MIN_FALL * (f64::from(samples) / f64::from(next)).sqrt();
            self.next = Self::beyond(samples);
            while error.is_finite() && error * fall(self.next) > limit.bound && self.next < u32::MAX
            {
                self.next = Self::beyond(self.next);
            }
            self.latest = Some((samples, error));
        }
    }

    /// The latest estimate.
    fn error(&self) -> Option<f64> {
        self.latest.map(|(_, error)| error)
    }

    /// Part of the samples that the bound needs; noise falls with their square root.
    fn fraction(&self, samples: u32) -> Option<f64> {
        let (limit, (at, error)) = self.limit.zip(self.latest)?;
        let then = (limit.bound / error).powi(2);
        error
            .is_finite()
            .then(|| then * f64::from(samples) / f64::from(at))
    }
}

/// Samples of the longest pass, after which the listener is called.
const MAX_PASS: u32 = 16;

/// Runs passes of an integrator from sample number `start` on until the budget is spent, the listener returns a break,
/// or the view's render is [stopped](Stop).
///
/// The listener is called after each pass with the picture so far. At the time limit or a requested stop the pass ends
/// early and does not count. A partial result is kept only in the very first pass, with 0 samples.
pub fn drive(
    integrator: &mut dyn Integrator,
    view: &View<'_>,
    budget: &Budget,
    start: u32,
    picture: &mut Picture,
    listener: &mut dyn FnMut(&RenderProgress, &Picture) -> ControlFlow<()>,
) -> (RenderProgress, Reason) {
    let clock = Instant::now();
    // A time limit beyond the range of the clock is no limit.
    let deadline = budget.time.and_then(|time| clock.checked_add(time));
    let stop = Stop::at(view.stop, deadline, start == 0);
    let view = &view.until(&stop);
    let mut samples = start;
    let mut length = 1u32;
    let mut estimates = Estimates::new(budget.error, start);
    let mut progress = RenderProgress {
        samples,
        elapsed: Duration::ZERO,
        fraction: None,
        error: None,
    };
    estimates.look(samples, picture);
    progress.error = estimates.error();
    loop {
        if let Some(reason) = reached(budget, &progress) {
            return (progress, reason);
        }
        let end = samples
            .saturating_add(length)
            .min(budget.samples.unwrap_or(u32::MAX))
            .min(estimates.next);
        let pass = Instant::now();
        let added = integrator.pass(view, samples..end, picture);
        let seconds = pass.elapsed().as_secs_f64() / f64::from(added.max(1));
        samples += added;
        if added > 0 {
            stop.end_first_sample();
        }
        let elapsed = clock.elapsed();
        estimates.look(samples, picture);
        progress = RenderProgress {
            samples,
            elapsed,
            // A new estimate may be above the prediction; the fraction must not fall.
            fraction: fraction(budget, start, samples, elapsed, estimates.fraction(samples))
                .map(|now| now.max(progress.fraction.unwrap_or(0.0))),
            error: estimates.error(),
        };
        if listener(&progress, picture).is_break() || stop.is_requested() {
            return (progress, Reason::Stopped);
        }
        if stop.is_cut() {
            return (progress, reached(budget, &progress).unwrap_or(Reason::Time));
        }
        length = next_length(length, seconds, budget, elapsed);
    }
}

/// The first bound that is reached.
fn reached(budget: &Budget, progress: &RenderProgress) -> Option<Reason> {
    if budget.samples.is_some_and(|s| progress.samples >= s) {
        Some(Reason::Samples)
    } else if budget.time.is_some_and(|t| progress.elapsed >= t) {
        Some(Reason::Time)
    } else if progress.samples >= MIN_SAMPLES_FOR_ERROR
        && budget
            .error
            .zip(progress.error)
            .is_some_and(|(limit, error)| error <= limit.bound)
    {
        Some(Reason::Error)
    } else {
        None
    }
}

/// Part of the budget that is spent, by the nearest bound.
fn fraction(
    budget: &Budget,
    start: u32,
    samples: u32,
    elapsed: Duration,
    by_error: Option<f64>,
) -> Option<f64> {
    let by_samples = budget
        .samples
        .map(|s| f64::from(samples - start) / f64::from(s.saturating_sub(start).max(1)));
    let by_time = budget.time.map(|t| elapsed.as_secs_f64() / t.as_secs_f64());
    let most = [by_samples, by_time, by_error]
        .into_iter()
        .flatten()
        .reduce(f64::max);
    most.map(|f| f.clamp(0.0, 1.0))
}

/// Samples of the next pass: doubled, but within a second and the remaining time.
fn next_length(length: u32, seconds_each: f64, budget: &Budget, elapsed: Duration) -> u32 {
    let left = budget
        .time
        .map_or(f64::INFINITY, |t| t.saturating_sub(elapsed).as_secs_f64());
    let room = (1.0f64.min(left) / seconds_each.max(1e-9)).clamp(1.0, f64::from(MAX_PASS)) as u32;
    (2 * length).min(room)
}
