//! The threads that compute. While they do, other threads of Python run, and Ctrl-C ends long work.

use crate::error::Refused;
use lightpath_optics::interrupt::{Interrupt, Interrupted};
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Time between two looks at Python's signals while long work sends no progress.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// Threads of short work, with the process that made them. A fork copies memory, but no threads.
static SHARED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs short work on the shared threads, without Python's lock.
pub(crate) fn compute<R: Send>(py: Python<'_>, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    py.detach(|| Ok(shared()?.install(work)))
}

fn shared() -> PyResult<Arc<ThreadPool>> {
    let mut shared = SHARED.lock().map_err(|_| PyRuntimeError::new_err("an earlier computation panicked"))?;
    let own = std::process::id();
    if let Some((process, pool)) = shared.as_ref()
        && *process == own
    {
        return Ok(pool.clone());
    }
    let pool = Arc::new(pool()?);
    if let Some(of_parent) = shared.replace((own, pool.clone())) {
        // Its threads are not in this process, and dropping it would wait for them.
        std::mem::forget(of_parent);
    }
    Ok(pool)
}

/// As many threads as `RAYON_NUM_THREADS` says, or as the processor has.
fn pool() -> PyResult<ThreadPool> {
    ThreadPoolBuilder::new().build().map_err(|error| PyOSError::new_err(format!("threads did not start: {error}")))
}

/// State of long work.
pub(crate) struct Progress {
    pub(crate) step: u32,
    pub(crate) steps_total: u32,
    pub(crate) loss: f64,
}

/// Runs long work on threads of its own, without Python's lock. Calls `progress(step, steps_total, loss)` in the
/// calling thread for each progress that the work sends.
///
/// # Errors
///
/// The error of the work, the exception of a signal such as `KeyboardInterrupt`, or that of `progress`. The last two
/// end the work.
pub(crate) fn compute_long<R: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Sender<Progress>) -> Result<R, Refused> + Send,
) -> PyResult<R> {
    // The flag of an interruption belongs to a pool, so that it ends no other work.
    let (pool, interrupt) = (pool()?, Interrupt::default());
    std::thread::scope(|scope| {
        let (sender, mut receiver) = channel();
        let (pool, interrupt) = (&pool, &interrupt);
        let worker = scope.spawn(move || pool.install(|| interrupt.run(|| work(&sender))));
        let mut exception = None;
        loop {
            let received;
            (receiver, received) = py.detach(move || {
                let received = receiver.recv_timeout(SIGNALS_EVERY);
                (receiver, received)
            });
            let watched = py.check_signals().and_then(|()| match (&received, progress) {
                (Ok(Progress { step, steps_total, loss }), Some(progress)) => {
                    progress.call1((*step, *steps_total, *loss)).map(drop)
                }
                _ => Ok(()),
            });
            if let Err(error) = watched {
                exception = Some(error);
                interrupt.raise();
                break;
            }
            if matches!(received, Err(RecvTimeoutError::Disconnected)) {
                break;
            }
        }
        let done = py.detach(|| worker.join());
        match (exception, done) {
            (Some(exception), _) => Err(exception),
            (None, Ok(Ok(result))) => Ok(result?),
            (None, Ok(Err(Interrupted))) => Err(PyRuntimeError::new_err("the computation was interrupted")),
            (None, Err(panic)) => std::panic::resume_unwind(panic),
        }
    })
}
