//! Signals that end a command. The first Ctrl-C, SIGTERM or SIGHUP requests an end, which integrators check between
//! tiles or chains; the second ends at once. Batch systems announce a time limit by SIGUSR1 and SIGXCPU, which request
//! an end however often they come. While a scene is loaded there is nothing to save, and each signal ends at once.

use super::output::note;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Flag that requests the end of a command.
#[derive(Clone)]
pub(super) struct Stop {
    asked: Arc<AtomicBool>,
    /// True while there is nothing to save.
    idle: Arc<AtomicBool>,
}

impl Stop {
    /// Installs the handlers. Until [`Stop::begin`] the first signal ends the program. If no handler can be set, the
    /// signals keep their default effect.
    pub(super) fn listen() -> Self {
        let stop = Self {
            asked: Arc::default(),
            idle: Arc::new(AtomicBool::new(true)),
        };
        stop.listen_to_batch_systems();
        let Self { asked, idle } = stop.clone();
        let handler = ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::Relaxed) || idle.load(Ordering::Relaxed) {
                std::process::exit(super::Exit::Stopped as i32);
            }
            note("opsr: stopping, saving the results so far (again to stop at once)");
        });
        if let Err(error) = handler {
            tracing::warn!("no handler for Ctrl-C: {error}");
        }
        stop
    }

    /// Handles SIGUSR1 and SIGXCPU. A second SIGXCPU comes a second after the first, and must not end the program.
    #[cfg(unix)]
    fn listen_to_batch_systems(&self) {
        use signal_hook::consts::{SIGUSR1, SIGXCPU};
        use signal_hook::iterator::Signals;
        let Self { asked, idle } = self.clone();
        let mut signals = match Signals::new([SIGUSR1, SIGXCPU]) {
            Ok(signals) => signals,
            Err(error) => return tracing::warn!("no handler for SIGUSR1 and SIGXCPU: {error}"),
        };
        std::thread::spawn(move || {
            for _ in signals.forever() {
                if idle.load(Ordering::Relaxed) {
                    std::process::exit(super::Exit::Stopped as i32);
                }
                if !asked.swap(true, Ordering::Relaxed) {
                    note("opsr: stopping, saving the results so far");
                }
            }
        });
    }

    #[cfg(not(unix))]
    fn listen_to_batch_systems(&self) {}

    /// Starts work whose results are saved when an end is requested.
    pub(super) fn begin(&self) {
        self.idle.store(false, Ordering::Relaxed);
    }

    /// True once an end was requested.
    pub(super) fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// The flag itself.
    pub(super) fn flag(&self) -> Arc<AtomicBool> {
        self.asked.clone()
    }

    /// The result of a callback: break once an end was requested.
    pub(super) fn flow(&self) -> ControlFlow<()> {
        match self.asked() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// The flag of a command that usually ends by Ctrl-C; a second Ctrl-C ends the program at once.
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
