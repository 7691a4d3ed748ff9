//! The flag that stops an attempt.

use std::sync::atomic::{AtomicU8, Ordering};

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
pub(super) struct StopFlag(AtomicU8);

impl StopFlag {
    pub(super) fn raise(&self, reason: StopReason) {
        self.0.fetch_max(reason as u8, Ordering::Relaxed);
    }

    pub(super) fn reason(&self) -> Option<StopReason> {
        match self.0.load(Ordering::Relaxed) {
            0 => None,
            1 => Some(StopReason::Drain),
            2 => Some(StopReason::Timeout),
            3 => Some(StopReason::Cancel),
            _ => Some(StopReason::LeaseLost),
        }
    }
}
