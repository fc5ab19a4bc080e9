//! Pace of work beside a render: files so far, the log, the error against a reference.

use std::time::{Duration, Instant};

/// Rest after work over the time that it took, so that it takes at most a fifth of a render.
const REST: u32 = 4;

/// When work that repeats is due again.
pub(super) struct Pace {
    every: Duration,
    /// End of the work before; `None` before the first.
    ended: Option<Instant>,
    took: Duration,
}

impl Pace {
    /// Work that is due at once, then this long after its end, or longer where it is slow.
    pub(super) fn at_once(every: Duration) -> Self {
        let (ended, took) = (None, Duration::ZERO);
        Self { every, ended, took }
    }

    /// The same, first due after this time.
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

    /// Does the work.
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
