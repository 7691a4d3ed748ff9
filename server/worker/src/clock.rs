//! The time of the day, as the store wants it, in a form that a jump of the system's clock cannot hurt.
//!
//! Leases are told in the time of the day, but only this process gives them out and takes them back. Its clock goes on
//! evenly from where it was started; when the system's clock has jumped away from it, [`Clock::jump`] says by how much,
//! and the live leases are moved along before the clock is.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// A difference up to this is the slow steering of a time service, or an imprecise look \[ms\].
const JUMP_MS: i64 = 1000;

/// A clock that goes evenly; clones are the same clock.
#[derive(Clone, Debug)]
pub struct Clock {
    started: Instant,
    /// What the clock shows at `started`.
    origin_ms: Arc<AtomicI64>,
    /// Added to the system's clock, in tests.
    skew_ms: Arc<AtomicI64>,
}

impl Default for Clock {
    fn default() -> Self {
        Self { started: Instant::now(), origin_ms: Arc::new(AtomicI64::new(system_ms())), skew_ms: Arc::default() }
    }
}

impl Clock {
    /// \[ms since 1970\]
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        let since_ms = i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX / 2);
        self.origin_ms.load(Ordering::SeqCst).saturating_add(since_ms)
    }

    /// How far the system's clock has jumped ahead of this one (negative: back) \[ms\]; `None` where it has not.
    #[must_use]
    pub fn jump(&self) -> Option<i64> {
        let ahead_ms = system_ms() + self.skew_ms.load(Ordering::SeqCst) - self.now_ms();
        (ahead_ms.abs() > JUMP_MS).then_some(ahead_ms)
    }

    /// Moves this clock.
    pub fn adjust(&self, by_ms: i64) {
        self.origin_ms.fetch_add(by_ms, Ordering::SeqCst);
    }

    /// Makes the system's clock look as if somebody had set it.
    #[cfg(test)]
    pub(super) fn set_system_clock(&self, by_ms: i64) {
        self.skew_ms.fetch_add(by_ms, Ordering::SeqCst);
    }
}

/// \[ms since 1970\]
fn system_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}
