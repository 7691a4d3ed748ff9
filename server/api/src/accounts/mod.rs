//! What each client uses: calls, memory, threads and streams, each with a limit for one client and one for all.
//!
//! A [`Client`] is the holder of a token, or a machine without one. No client can use up what others need:
//!
//! | what | limit for all | limit for one client |
//! |---|---|---|
//! | calls (`rate`) | none | `calls_per_s_max` of the settings |
//! | memory for messages (`memory_budget`) | `under_way_mib_max` | three quarters of it, by address |
//! | memory for computations (`turns`) | `computing_mib_max` | half of it; a quarter is kept for those that spent little |
//! | threads for computations (`turns`) | [`COMPUTATIONS_MAX`] | all but two; the client that spent least is next |
//! | streams (`streams`) | a number for each kind | half or a quarter of it |

mod client;
mod memory_budget;
mod rate;
mod streams;
mod turns;

use crate::call::Call;
use crate::error::ApiError;
pub(crate) use client::Client;
use lightpath_optics::interrupt::Interrupt;
pub use memory_budget::MemoryBudget;
pub(crate) use memory_budget::Share;
pub use rate::Rate;
pub(crate) use streams::{OpenStream, StreamKind, Streams};
use turns::{TurnLimits, Turns};

/// Limit on the computations that run at once. They share the cores with jobs, which have a lower priority.
const COMPUTATIONS_MAX: usize = 6;

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

    /// Runs `compute`, which needs `bytes` of memory, on a thread that may block, when it is the client's turn. The
    /// memory stays counted until `compute` has ended, even if the call is cancelled. A cancelled call interrupts `compute`
    /// where it looks at the interrupt, for example in the decoders of pictures.
    ///
    /// # Errors
    ///
    /// [`ApiError::TooLarge`] if `compute` needs more memory than one client may use; [`ApiError::Exhausted`] if too many
    /// computations wait; [`ApiError::Cancelled`] if the client leaves before the turn comes; [`ApiError::Task`] if
    /// `compute` panics.
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
        let mut work = tokio::task::spawn_blocking(move || {
            let result = own.run_on_this_thread(compute);
            drop(turn);
            result
        });
        let result = tokio::select! {
            biased;
            result = &mut work => result,
            () = call.cancelled.cancelled() => {
                interrupt.raise();
                work.await
            }
        };
        result.map_err(ApiError::Task)?.map_err(|_| ApiError::Cancelled)
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
