//! Pace of repeated work during a render: files, log, error against a reference.

use std::time::{Duration, Instant};

/// Pause after work in units of its duration, so that the work takes at most a fifth of a render.
const REST: u32 = 4;

/// Determines the next time of repeated work.
pub(super) struct Pace {
    every: Duration,
    /// End of the last work; `None` before the first.
    ended: Option<Instant>,
    took: Duration,
}

impl Pace {
    /// Work that is due at once, and again this long after its end, or later if it is slow.
    pub(super) fn at_once(every: Duration) -> Self {
        let (ended, took) = (None, Duration::ZERO);
        Self { every, ended, took }
    }

    /// Work that is first due after this time.
    pub(super) fn after(every: Duration) -> Self {
        let ended = Some(Instant::now());
        Self {
            ended,
            ..Self::at_once(every)
        }
    }

    /// True if it is time for the work.
    pub(super) fn is_due(&self) -> bool {
        let rest = self.every.max(REST * self.took);
        self.ended.is_none_or(|ended| ended.elapsed() >= rest)
    }

    /// Runs the work and measures its duration.
    pub(super) fn spend<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let done = work();
        let ended = Instant::now();
        (self.ended, self.took) = (Some(ended), ended - begun);
        done
    }
}

#[cfg(test)]
mod tests;
