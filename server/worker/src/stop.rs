//! The flag that stops an attempt.

use std::sync::atomic::{AtomicU8, Ordering};

/// Why an attempt stops before its end. A later reason outweighs an earlier one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum StopReason {
    /// The server stops: save the state, the job goes on later.
    Drain = 1,
    /// The attempt has taken as long as it may.
    Timeout = 2,
    /// Somebody asked for the end of the job.
    Cancel = 3,
    /// The job is no longer this worker's: nothing that it does will count.
    LeaseLost = 4,
}

/// Shared between an attempt and its compute thread.
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
