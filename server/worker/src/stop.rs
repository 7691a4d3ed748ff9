//! The flag that stops an attempt.

use lightpath_optics::interrupt::Interrupt;
use std::future::Future;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;
use tokio::time::sleep;

/// Interval at which a wait or a read of a file looks at the flag: short beside the second within which a job must
/// stop.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// Reason why an attempt must stop before its end. A reason with a higher number replaces one with a lower number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum StopReason {
    /// The server stops: the task saves its state, and the job continues later.
    Drain = 1,
    /// The attempt has reached its time limit.
    Timeout = 2,
    /// A user cancelled the job.
    Cancel = 3,
    /// The worker no longer holds the job, so its further work has no effect.
    LeaseLost = 4,
}

/// The stop flag, shared between an attempt and its compute thread.
#[derive(Debug, Default)]
pub(super) struct StopFlag {
    reason: AtomicU8,
    interrupt: Interrupt,
}

impl StopFlag {
    /// Stops the attempt. A draining attempt may first end its step and save its state; every other reason interrupts
    /// the computation at once.
    pub(super) fn raise(&self, reason: StopReason) {
        self.reason.fetch_max(reason as u8, Ordering::Relaxed);
        if reason > StopReason::Drain {
            self.interrupt.raise();
        }
    }

    pub(super) fn reason(&self) -> Option<StopReason> {
        match self.reason.load(Ordering::Relaxed) {
            0 => None,
            1 => Some(StopReason::Drain),
            2 => Some(StopReason::Timeout),
            3 => Some(StopReason::Cancel),
            _ => Some(StopReason::LeaseLost),
        }
    }

    /// Ends the computation of the attempt within milliseconds.
    pub(super) fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// The output of `future`; `None` if the attempt must stop before. The future is then dropped.
    pub(super) async fn unless_stopped<F: Future>(&self, future: F) -> Option<F::Output> {
        self.unless(future, || self.reason().is_some()).await
    }

    /// The output of `future`; `None` if the computation was interrupted first. The future is then dropped.
    pub(super) async fn unless_interrupted<F: Future>(&self, future: F) -> Option<F::Output> {
        self.unless(future, || self.interrupt.is_raised()).await
    }

    async fn unless<F: Future>(&self, future: F, ends: impl Fn() -> bool) -> Option<F::Output> {
        let ended = async {
            while !ends() {
                sleep(LOOK_INTERVAL).await;
            }
        };
        tokio::select! {
            biased;
            output = future => Some(output),
            () = ended => None,
        }
    }
}
