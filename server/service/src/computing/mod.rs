//! Computations for calls: each on a thread of its own, when it is its client's turn, with its memory counted.
//!
//! What takes longer than a second is a job. What a call computes in that second may still need hundreds of megabytes.

mod turns;

use crate::call::Call;
use crate::error::{LimitReason, Result, ServiceError};
use lightpath_optics::interrupt::Interrupt;
use std::io;
use tokio::sync::oneshot;
use turns::{RETRY, TurnLimits, Turns};

/// Limit on the computations that run at once. They share the cores with jobs, which have a lower priority.
const COMPUTATIONS_MAX: usize = 6;
/// Scheduling priority of these computations, as of the command `nice`: between the threads that answer calls, which
/// get a core at once, and those of jobs.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 5;

/// The computations for calls. Clones share their turns.
#[derive(Clone, Debug)]
pub struct Computing {
    turns: Turns,
}

impl Computing {
    /// Computations with a limit on the memory of all of them together \[bytes\]. One client may use half of it.
    #[must_use]
    pub fn new(bytes_max: u64) -> Self {
        Self { turns: Turns::new(TurnLimits { at_once: COMPUTATIONS_MAX, bytes: bytes_max }) }
    }

    /// Runs `compute`, which needs `bytes` of memory, on a thread of its own, when it is the client's turn. The
    /// memory stays counted until `compute` has ended, even if the call is cancelled. A cancelled call interrupts
    /// `compute` where it looks at the interrupt, for example in the decoders of pictures.
    ///
    /// # Errors
    ///
    /// [`ServiceError::TooLarge`] if `compute` needs more memory than one client may use; [`ServiceError::Exhausted`] if too
    /// many computations wait or the system has no thread; [`ServiceError::Cancelled`] if the client leaves before the turn
    /// comes; [`ServiceError::Panicked`] if `compute` panics.
    pub async fn run<T: Send + 'static>(
        &self,
        call: &Call,
        bytes: u64,
        compute: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        let turn = tokio::select! {
            biased;
            () = call.cancelled.cancelled() => return Err(ServiceError::Cancelled),
            turn = self.turns.wait(&call.client, bytes) => turn?,
        };
        let interrupt = Interrupt::default();
        let own = interrupt.clone();
        let (done, mut result) = oneshot::channel();
        let work = move || {
            yield_to_calls();
            let result = own.run_on_this_thread(compute);
            drop(turn);
            // The call waits for this result. The send fails only when the process is ending.
            drop(done.send(result));
        };
        std::thread::Builder::new().name("computation".to_owned()).spawn(work).map_err(no_thread)?;
        let result = tokio::select! {
            biased;
            result = &mut result => result,
            () = call.cancelled.cancelled() => {
                interrupt.raise();
                result.await
            }
        };
        // A panic drops the sender.
        result.map_err(|_| ServiceError::Panicked)?.map_err(|_| ServiceError::Cancelled)
    }
}

fn no_thread(error: io::Error) -> ServiceError {
    let message = format!("the system has no thread for a computation: {error}; retry later");
    ServiceError::Exhausted { reason: LimitReason::TooMuchUnderWay, message, retry_after: RETRY }
}

/// Lowers the priority of the calling thread below those that answer calls. On systems other than Linux, the priority
/// belongs to the whole process.
fn yield_to_calls() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(None, NICENESS) {
        tracing::warn!(%error, "the priority of a computation could not be lowered; calls may be slower");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;
    use std::time::Duration;

    #[tokio::test]
    async fn a_cancelled_call_keeps_its_memory_until_its_computation_ends() {
        let computing = Computing::new(100);
        let (first, second) = (Call::without_token(), Call::without_token());
        let (go, wait) = mpsc::channel::<()>();
        let (shared, call) = (computing.clone(), first.clone());
        let cancelled = tokio::spawn(async move { shared.run(&call, 50, move || wait.recv()).await });
        tokio::task::yield_now().await;
        first.cancelled.cancel();
        cancelled.abort();
        let (shared, call) = (computing.clone(), second.clone());
        let mut next = tokio::spawn(async move { shared.run(&call, 50, || ()).await });
        assert!(tokio::time::timeout(Duration::from_millis(50), &mut next).await.is_err(), "the memory is in use");
        go.send(()).unwrap();
        next.await.unwrap().unwrap();
    }

    #[tokio::test]
    async fn a_call_that_is_cancelled_while_it_waits_computes_nothing() {
        let computing = Computing::new(100);
        let call = Call::without_token();
        call.cancelled.cancel();
        let refusal = computing.run(&call, 1, || unreachable!("the client has left")).await;
        assert!(matches!(refusal, Err(ServiceError::Cancelled)));
    }
}
