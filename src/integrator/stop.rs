//! The end of a render in the middle of a pass.
//!
//! Integrators ask `View::stopped` before every tile, chain or iteration. What a pass that ends early
//! has done is left out: a picture holds whole samples only, so that it can be resumed and merged bit for bit. The first pass
//! is the exception, since there is no other picture: its finished tiles or chains are kept, and no checkpoint is made of it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time that the first sample may take at least.
const FIRST: Duration = Duration::from_millis(500);

/// A request to end a render, and a time at which it ends.
#[derive(Debug, Default)]
pub struct Stop<'a> {
    /// Flag that a user sets.
    asked: Option<&'a AtomicBool>,
    /// Time that the render may take.
    deadline: Option<Instant>,
    /// True while there is no whole sample.
    first: AtomicBool,
    /// True once an integrator has left work out.
    cut: AtomicBool,
}

impl<'a> Stop<'a> {
    /// An end when the flag is set.
    pub fn when(asked: &'a AtomicBool) -> Self {
        Self {
            asked: Some(asked),
            ..Self::default()
        }
    }

    /// The same request, and an end at this time; `first` if there is no whole sample.
    pub(super) fn at(other: Option<&Stop<'a>>, deadline: Option<Instant>, first: bool) -> Self {
        // Of a small picture the first sample is whole, whatever the time.
        let least = Instant::now() + FIRST;
        let deadline = deadline.map(|deadline| if first { deadline.max(least) } else { deadline });
        Self {
            asked: other.and_then(|other| other.asked),
            deadline,
            first: first.into(),
            cut: false.into(),
        }
    }

    /// True once a user has asked for an end.
    pub(super) fn is_asked(&self) -> bool {
        self.asked
            .is_some_and(|asked| asked.load(Ordering::Relaxed))
    }

    /// True if the next tile, chain or iteration is to be left out; remembers it.
    pub(super) fn now(&self) -> bool {
        let late = || {
            self.deadline
                .is_some_and(|deadline| Instant::now() >= deadline)
        };
        let now = self.cut.load(Ordering::Relaxed) || self.is_asked() || late();
        if now {
            self.cut.store(true, Ordering::Relaxed);
        }
        now
    }

    /// True if anything was left out.
    pub(super) fn is_cut(&self) -> bool {
        self.cut.load(Ordering::Relaxed)
    }

    /// True while there is no whole sample.
    pub(super) fn is_first(&self) -> bool {
        self.first.load(Ordering::Relaxed)
    }

    /// There is a whole sample.
    pub(super) fn begun(&self) {
        self.first.store(false, Ordering::Relaxed);
    }
}
