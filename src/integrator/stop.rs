//! The end of a render in the middle of a pass.
//!
//! The driver of pieces checks before every tile, chunk of light paths, or chain. The results of a pass that ends early
//! are dropped: a picture holds whole samples only, so that it can be resumed and merged bit for bit. The first pass is
//! the exception, since there is no other picture: its finished tiles or chains are kept, and no checkpoint is made of
//! it. The first sample has twice the time limit of the render. In it, shared work such as light paths ends at half of
//! that. The dependent steps get at least as much time as the shared work took.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Least time limit of the first sample.
const FIRST: Duration = Duration::from_millis(500);

/// Time limit of the first sample over that of the render: a picture without holes is worth the delay.
const FIRST_OVERRUN: u32 = 2;

/// Time limit of the first sample of a render with this time limit.
pub(crate) fn first_limit(length: Duration) -> Duration {
    length.saturating_mul(FIRST_OVERRUN).max(FIRST)
}

/// A request to end a render, and a time at which it ends.
#[derive(Debug, Default)]
pub struct Stop<'a> {
    /// Flag that a user sets.
    stop_flag: Option<&'a AtomicBool>,
    /// Time that the render may take.
    limit: Option<Limit>,
    /// True while there is no whole sample.
    first: AtomicBool,
    /// True once an integrator has skipped work.
    cut: AtomicBool,
    /// True once it has skipped shared work, on which its other work depends.
    shared_cut: AtomicBool,
}

/// A limit of time.
#[derive(Debug)]
struct Limit {
    /// The start of the time.
    begin: Instant,
    /// Length, in nanoseconds; longer for the first sample.
    length: AtomicU64,
    /// Length after the first sample, in nanoseconds.
    of_others: u64,
}

impl Limit {
    /// True if this part of the time is over.
    fn is_over(&self, part: f64) -> bool {
        let length = Duration::from_nanos(self.length.load(Ordering::Relaxed));
        self.begin.elapsed() >= length.mul_f64(part)
    }
}

impl<'a> Stop<'a> {
    /// A stop when the flag is set.
    pub fn when(stop_flag: &'a AtomicBool) -> Self {
        Self {
            stop_flag: Some(stop_flag),
            ..Self::default()
        }
    }

    /// The same request, and a stop at this time; `first` if there is no whole sample.
    pub(super) fn at(other: Option<&Stop<'a>>, deadline: Option<Instant>, first: bool) -> Self {
        let begin = Instant::now();
        let limit = deadline.map(|end| {
            let length = end.saturating_duration_since(begin);
            let nanos = |length: Duration| length.as_nanos().try_into().unwrap_or(u64::MAX);
            let now = nanos(match first {
                true => first_limit(length),
                false => length,
            });
            let (length, of_others) = (now.into(), nanos(length));
            Limit {
                begin,
                length,
                of_others,
            }
        });
        Self {
            stop_flag: other.and_then(|other| other.stop_flag),
            limit,
            first: first.into(),
            cut: false.into(),
            shared_cut: false.into(),
        }
    }

    /// True once a user has requested a stop.
    pub(super) fn is_requested(&self) -> bool {
        self.stop_flag
            .is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// True if the next tile, chain or iteration must be skipped; stays true from then on.
    pub(super) fn skips_next(&self) -> bool {
        self.is_over(1.0, &self.cut)
    }

    /// The same for shared work of the first sample, at half of the time.
    pub(super) fn skips_shared(&self) -> bool {
        self.is_over(0.5, &self.shared_cut)
    }

    /// Lengthens the first sample to twice the time so far, if that is more.
    pub(super) fn extend_first_sample(&self) {
        if let (true, Some(limit)) = (self.is_first(), &self.limit) {
            let twice = 2 * limit.begin.elapsed();
            let twice = twice.as_nanos().try_into().unwrap_or(u64::MAX);
            limit.length.fetch_max(twice, Ordering::Relaxed);
        }
    }

    /// True if the flag is set, a stop is requested or this part of the time is over; then sets the flag.
    fn is_over(&self, part: f64, flag: &AtomicBool) -> bool {
        let late = || self.limit.as_ref().is_some_and(|limit| limit.is_over(part));
        let over = flag.load(Ordering::Relaxed) || self.is_requested() || late();
        if over {
            flag.store(true, Ordering::Relaxed);
        }
        over
    }

    /// True if anything was skipped.
    pub(super) fn is_cut(&self) -> bool {
        self.cut.load(Ordering::Relaxed) || self.shared_cut.load(Ordering::Relaxed)
    }

    /// True while there is no whole sample.
    pub(super) fn is_first(&self) -> bool {
        self.first.load(Ordering::Relaxed)
    }

    /// Called once there is a whole sample.
    pub(super) fn end_first_sample(&self) {
        self.first.store(false, Ordering::Relaxed);
        if let Some(limit) = &self.limit {
            limit.length.store(limit.of_others, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests;
