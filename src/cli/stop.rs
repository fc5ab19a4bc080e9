//! Ctrl-C and SIGTERM: the first asks for an end after the current pass, the second ends at once.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Flag that the user sets to end a command.
#[derive(Clone)]
pub(super) struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Listens from now on. Where no handler can be set the signals keep their usual meaning.
    pub(super) fn listen() -> Self {
        let flag = Arc::new(AtomicBool::new(false));
        let seen = flag.clone();
        let handler = ctrlc::set_handler(move || {
            if seen.swap(true, Ordering::Relaxed) {
                std::process::exit(super::Exit::Stopped as i32);
            }
            eprintln!(
                "opsr: stopping after this pass, saving the results so far (again to stop at once)"
            );
        });
        if let Err(error) = handler {
            tracing::warn!("no handler for Ctrl-C: {error}");
        }
        Self(flag)
    }

    /// True once an end was asked for.
    pub(super) fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The answer of a listener.
    pub(super) fn flow(&self) -> ControlFlow<()> {
        match self.asked() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}
