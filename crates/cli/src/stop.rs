//! Ctrl-C and SIGTERM: the first asks for an end, which integrators find between tiles or chains; the second ends at once. While a scene is loaded
//! there is nothing to wait for, and the first ends at once.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Flag that the user sets to end a command.
#[derive(Clone)]
pub(super) struct Stop {
    asked: Arc<AtomicBool>,
    /// True while there is nothing to save.
    idle: Arc<AtomicBool>,
}

impl Stop {
    /// Listens from now on; until [`Stop::begin`] the first signal ends the program. Where no handler can be set the
    /// signals keep their usual meaning.
    pub(super) fn listen() -> Self {
        let stop = Self {
            asked: Arc::default(),
            idle: Arc::new(AtomicBool::new(true)),
        };
        let Self { asked, idle } = stop.clone();
        let handler = ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::Relaxed) || idle.load(Ordering::Relaxed) {
                std::process::exit(super::Exit::Stopped as i32);
            }
            eprintln!("opsr: stopping, saving the results so far (again to stop at once)");
        });
        if let Err(error) = handler {
            tracing::warn!("no handler for Ctrl-C: {error}");
        }
        stop
    }

    /// Work begins whose results are saved when an end is asked for.
    pub(super) fn begin(&self) {
        self.idle.store(false, Ordering::Relaxed);
    }

    /// True once an end was asked for.
    pub(super) fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// The flag itself.
    pub(super) fn flag(&self) -> Arc<AtomicBool> {
        self.asked.clone()
    }

    /// The answer of a listener.
    pub(super) fn flow(&self) -> ControlFlow<()> {
        match self.asked() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// The flag that Ctrl-C sets where it is the usual end of a command; again, it ends the program at once.
pub(super) fn ended() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let flag = ended.clone();
    let handler = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(super::Exit::Stopped as i32);
        }
    });
    if let Err(error) = handler {
        tracing::warn!("no handler for Ctrl-C: {error}");
    }
    ended
}
