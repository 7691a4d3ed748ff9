//! What each client uses: calls, memory, threads and streams, each with a limit for one client and one for all.
//!
//! A [`Client`] is the holder of a token, or a machine without one. No client can use up what others need:
//!
//! | what | limit for all | limit for one client |
//! |---|---|---|
//! | calls (`rate`) | none | `calls_per_s_max` of the settings, divided by the number of living servers |
//! | memory for messages (`memory_budget`) | `under_way_mib_max` | three quarters of it, by address |
//! | memory for computations (`turns`) | `computing_mib_max` | half of it; a quarter is kept for those that spent little |
//! | threads for computations (`turns`) | [`COMPUTATIONS_MAX`] | all but two; the client that spent least is next |
//! | streams (`streams`) | a number for each kind | half or a quarter of it |
//! | connections (`streams`) | 800, 400 from one address | 100 for a token |

mod client;
mod memory_budget;
mod rate;
mod streams;
mod turns;

use crate::call::Call;
use crate::error::{ApiError, LimitReason};
pub(crate) use client::Client;
use lightpath_optics::interrupt::Interrupt;
pub use memory_budget::MemoryBudget;
pub(crate) use memory_budget::Share;
pub use rate::Rate;
use std::io;
pub(crate) use streams::{OpenStream, StreamKind, Streams};
use tokio::sync::oneshot;
use turns::{RETRY, TurnLimits, Turns};

/// Limit on the computations that run at once. They share the cores with jobs, which have a lower priority.
const COMPUTATIONS_MAX: usize = 6;
/// Scheduling priority of these computations, as of the command `nice`: between the threads that answer calls, which
/// get a core at once, and those of jobs.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 5;

/// What clients use of the server besides messages and calls per second. Clones share it.
#[derive(Clone, Debug)]
pub(crate) struct Accounts {
    turns: Turns,
    pub(crate) streams: Streams,
}

impl Accounts {
    /// Accounts with a limit on the memory of all computations together \[bytes\].
    pub(crate) fn new(computing_bytes: u64) -> Self {
        let limits = TurnLimits { at_once: COMPUTATIONS_MAX, bytes: computing_bytes };
        Self { turns: Turns::new(limits), streams: Streams::default() }
    }

    /// Runs `compute`, which needs `bytes` of memory, on a thread of its own, when it is the client's turn. The
    /// memory stays counted until `compute` has ended, even if the call is cancelled. A cancelled call interrupts
    /// `compute` where it looks at the interrupt, for example in the decoders of pictures.
    ///
    /// # Errors
    ///
    /// [`ApiError::TooLarge`] if `compute` needs more memory than one client may use; [`ApiError::Exhausted`] if too
    /// many computations wait or the system has no thread; [`ApiError::Cancelled`] if the client leaves before the turn
    /// comes; [`ApiError::Panicked`] if `compute` panics.
    pub(crate) async fn compute<T: Send + 'static>(
        &self,
        call: &Call,
        bytes: u64,
        compute: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let turn = tokio::select! {
            biased;
            () = call.cancelled.cancelled() => return Err(ApiError::Cancelled),
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
        result.map_err(|_| ApiError::Panicked)?.map_err(|_| ApiError::Cancelled)
    }
}

fn no_thread(error: io::Error) -> ApiError {
    let message = format!("the system has no thread for a computation: {error}; retry later");
    ApiError::Exhausted { reason: LimitReason::TooMuchUnderWay, message, retry_after: RETRY }
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
        let accounts = Accounts::new(100);
        let (first, second) = (Call::without_token(), Call::without_token());
        let (go, wait) = mpsc::channel::<()>();
        let (shared, call) = (accounts.clone(), first.clone());
        let computing = tokio::spawn(async move { shared.compute(&call, 50, move || wait.recv()).await });
        tokio::task::yield_now().await;
        first.cancelled.cancel();
        computing.abort();
        let (shared, call) = (accounts.clone(), second.clone());
        let mut next = tokio::spawn(async move { shared.compute(&call, 50, || ()).await });
        assert!(tokio::time::timeout(Duration::from_millis(50), &mut next).await.is_err(), "the memory is in use");
        go.send(()).unwrap();
        next.await.unwrap().unwrap();
    }

    #[tokio::test]
    async fn a_call_that_is_cancelled_while_it_waits_computes_nothing() {
        let accounts = Accounts::new(100);
        let call = Call::without_token();
        call.cancelled.cancel();
        let refusal = accounts.compute(&call, 1, || unreachable!("the client has left")).await;
        assert!(matches!(refusal, Err(ApiError::Cancelled)));
    }
}
