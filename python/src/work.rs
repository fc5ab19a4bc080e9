//! Work without the GIL, on threads of its own, that Ctrl-C and a callback can stop.

use crate::errors::argument;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Interval between two checks for signals.
const INTERVAL: Duration = Duration::from_millis(50);

/// A callback for events of type `E`: false asks the work to stop.
pub(crate) type OnEvent<'a, E> =
    Option<&'a mut (dyn FnMut(Python<'_>, E) -> PyResult<bool> + Send)>;

/// The work's end of the link to the calling thread: reports events and has the stop flag.
pub(crate) struct Link<E> {
    /// Set when the work is to stop.
    pub(crate) stop: Arc<AtomicBool>,
    /// Channels of events to a callback and of its answers.
    callback: Option<(SyncSender<E>, Receiver<()>)>,
    /// Dropped with the link: the closed channel ends the loop in [`watched`].
    _open: SyncSender<E>,
}

impl<E> Link<E> {
    /// True if the work is to stop.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Reports an event and waits for the callback, if there is one; breaks if the work is to stop.
    pub(crate) fn tell(&self, event: impl FnOnce() -> E) -> ControlFlow<()> {
        if let Some((events, answers)) = &self.callback
            && events.send(event()).is_ok()
        {
            // An error means that the calling thread does not listen any more.
            let _ = answers.recv();
        }
        match self.stopped() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// True unless the answer of a callback is false: Python's, or another library's such as `numpy.False_`.
pub(crate) fn goes_on(answer: &Bound<'_, PyAny>) -> bool {
    answer.is_none() || answer.extract::<bool>().unwrap_or(true)
}

/// Does work in a pool of `threads`, all cores by default, while this thread checks signals and calls `on_event`.
///
/// The pool ends with the work, since a process that is forked later would inherit the pool without its threads.
pub(crate) fn watched<E: Send, T: Send>(
    py: Python<'_>,
    threads: Option<u16>,
    mut on_event: OnEvent<'_, E>,
    work: impl FnOnce(&Link<E>) -> T + Send,
) -> PyResult<T> {
    if threads == Some(0) {
        return Err(argument("threads", "expected at least 1"));
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads.map_or(0, usize::from));
    let pool = pool.build().map_err(|e| {
        PyRuntimeError::new_err(format!("threads: cannot start that many threads: {e}"))
    })?;
    py.detach(|| {
        let stop = Arc::new(AtomicBool::new(false));
        let (events, received) = sync_channel(0);
        let (answer, answers) = sync_channel(1);
        let link = Link {
            stop: stop.clone(),
            callback: on_event.is_some().then(|| (events.clone(), answers)),
            _open: events,
        };
        let (mut result, mut error) = (None, None);
        let (made, failed) = (&mut result, &mut error);
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| {
                *made = Some(work(&link));
            });
            loop {
                let event = match received.recv_timeout(INTERVAL) {
                    Ok(event) => Some(event),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => return,
                };
                let waits = event.is_some();
                let answered = Python::attach(|py| {
                    py.check_signals()?;
                    match (event, &mut on_event) {
                        (Some(event), Some(on_event)) => on_event(py, event),
                        _ => Ok(true),
                    }
                });
                if !matches!(answered, Ok(true)) {
                    stop.store(true, Ordering::Relaxed);
                }
                if let Err(problem) = answered {
                    failed.get_or_insert(problem);
                }
                if waits {
                    let _ = answer.send(());
                }
            }
        });
        match (error, result) {
            (Some(error), _) => Err(error),
            (None, Some(result)) => Ok(result),
            // Not reached by a panic of the work, which leaves the scope.
            (None, None) => Err(PyRuntimeError::new_err("the work has no result")),
        }
    })
}

/// Does work without events in [`watched`], to its end.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    watched::<(), T>(py, None, None, |_| work())
}
