//! Computations for calls: each on threads of its own, when it is its client's turn, with its memory counted.
//!
//! What takes longer than a second is a job. What a call computes in that second may still need hundreds of megabytes.

mod turns;

use crate::call::Call;
use crate::error::{LimitReason, Result, ServiceError};
use lightpath_optics::interrupt::Interrupt;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use std::num::NonZero;
use std::thread::available_parallelism;
use tokio::sync::oneshot;
use turns::{RETRY, TurnLimits, Turns};

/// Limit on the computations that run at once. They share the cores with jobs, which have a lower priority.
const COMPUTATIONS_MAX: usize = 6;
/// Limit on the threads of one computation.
const THREADS_MAX: usize = 4;
/// Largest memory of a computation that ends within milliseconds \[bytes\], such as reading the header of a picture.
const SMALL_BYTES: u64 = 32 << 20;
/// Scheduling priority of small computations and of all others, as of the command `nice`: between the threads that answer
/// calls, which get a core at once, and those of jobs. A small one that had the priority of the others would wait for its
/// share of the cores beside all their threads.
const NICENESS: [i32; 2] = [1, 8];

/// The computations for calls. Clones share their turns.
#[derive(Clone, Debug)]
pub struct Computing {
    turns: Turns,
}

impl Computing {
    /// Computations with a limit on the memory of all of them together \[bytes\]. One client may use half of it.
    #[must_use]
    pub fn new(bytes_max: u64) -> Self {
        Self { turns: Turns::new(TurnLimits { at_once: COMPUTATIONS_MAX, bytes: bytes_max, small_bytes: SMALL_BYTES }) }
    }

    /// Runs `compute`, which needs `bytes` of memory, in a rayon pool of its own, when it is the client's turn. The
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
            let result = own.run(compute);
            drop(turn);
            // The call waits for this result. The send fails only when the process is ending.
            drop(done.send(result));
        };
        let niceness = NICENESS[usize::from(bytes > SMALL_BYTES)];
        own_pool(niceness).map_err(no_threads)?.spawn(work);
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

/// Threads for one computation, which end with it. In a pool that computations share, a small one can wait for a minute
/// behind large ones, because its threads take the parts of what they have begun first.
fn own_pool(niceness: i32) -> std::result::Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new()
        .num_threads(available_parallelism().map_or(1, NonZero::get).min(THREADS_MAX))
        .thread_name(|_| "computation".to_owned())
        .start_handler(move |_| yield_to_calls(niceness))
        // The call learns of a panic by itself. Without a handler, it would end the process.
        .panic_handler(drop)
        .build()
}

fn no_threads(error: ThreadPoolBuildError) -> ServiceError {
    let message = format!("the system has no threads for a computation: {error}; retry later");
    ServiceError::Exhausted { reason: LimitReason::TooMuchUnderWay, message, retry_after: RETRY }
}

/// Lowers the priority of the calling thread below those that answer calls. On systems other than Linux, the priority
/// belongs to the whole process.
#[cfg(target_os = "linux")]
fn yield_to_calls(niceness: i32) {
    if let Err(error) = rustix::process::setpriority_process(None, niceness) {
        tracing::warn!(%error, "the priority of a computation could not be lowered; calls may be slower");
    }
}

#[cfg(not(target_os = "linux"))]
fn yield_to_calls(_niceness: i32) {}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, mpsc};
    use std::thread;
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
    async fn a_computation_waits_for_no_threads_of_another_and_a_panic_ends_only_itself() {
        let computing = Computing::new(100);
        let (call, end) = (Call::without_token(), Arc::new(AtomicBool::new(false)));
        let wait = {
            let end = end.clone();
            move || {
                while !end.load(Ordering::Relaxed) {
                    thread::yield_now()
                }
            }
        };
        let (shared, slow_call) = (computing.clone(), call.clone());
        let slow =
            tokio::spawn(async move { shared.run(&slow_call, 1, move || drop(rayon::broadcast(|_| wait()))).await });
        tokio::task::yield_now().await;
        let sum = || (0..1000_u32).into_par_iter().sum::<u32>();
        assert_eq!(computing.run(&call, 1, sum).await.unwrap(), 499_500);
        let panicked = computing.run(&call, 1, || panic!("as planned")).await;
        assert!(matches!(panicked, Err::<(), _>(ServiceError::Panicked)));
        end.store(true, Ordering::Relaxed);
        slow.await.unwrap().unwrap();
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
