//! The time of day for the store, unaffected by jumps of the system's clock.
//!
//! Leases end at a time of day. In SQLite only this process gives them out and takes them back. Its clock runs evenly
//! from its start. When the system's clock has jumped, [`Clock::jump`] returns the difference; the ends of the leases are
//! moved by it, and then the clock.
//!
//! In PostgreSQL all processes give out leases and take them back, by the clock of the database. When that has jumped, no
//! lease is taken back for some time, in which heartbeats move the ends of all leases of living workers.

use lightpath_store::Store;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Largest difference that does not count as a jump \[ms\]. Smaller differences come from time services or from
/// imprecise readings.
const JUMP_MS: i64 = 1000;

/// A clock that runs evenly. Clones share the same time.
#[derive(Clone, Debug)]
pub struct Clock {
    started: Instant,
    /// Time of day at `started` \[ms since 1970\].
    origin_ms: Arc<AtomicI64>,
    /// Offset that tests add to the system's clock \[ms\].
    skew_ms: Arc<AtomicI64>,
    /// The database whose clock counts, if several processes share it.
    database: Option<Store>,
}

impl Default for Clock {
    fn default() -> Self {
        let origin_ms = Arc::new(AtomicI64::new(system_ms()));
        Self { started: Instant::now(), origin_ms, skew_ms: Arc::default(), database: None }
    }
}

impl Clock {
    /// The clock for leases in `store`.
    pub(super) fn of(store: &Store) -> Self {
        Self { database: store.is_shared().then(|| store.clone()), ..Self::default() }
    }

    /// Present time \[ms since 1970\].
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        if let Some(store) = &self.database {
            return store.now_ms();
        }
        let since_ms = i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX / 2);
        self.origin_ms.load(Ordering::SeqCst).saturating_add(since_ms)
    }

    /// How far the system's clock is ahead of this one (negative: behind) after a jump \[ms\]; `None` if it has not
    /// jumped, or if the clock of the database counts.
    #[must_use]
    pub fn jump(&self) -> Option<i64> {
        if self.database.is_some() {
            return None;
        }
        let ahead_ms = system_ms() + self.skew_ms.load(Ordering::SeqCst) - self.now_ms();
        (ahead_ms.abs() > JUMP_MS).then_some(ahead_ms)
    }

    /// Moves this clock by `by_ms`.
    pub fn adjust(&self, by_ms: i64) {
        self.origin_ms.fetch_add(by_ms, Ordering::SeqCst);
    }

    /// Simulates a change of the system's clock by `by_ms`.
    #[cfg(test)]
    pub(super) fn set_system_clock(&self, by_ms: i64) {
        self.skew_ms.fetch_add(by_ms, Ordering::SeqCst);
    }
}

/// Time of the system's clock \[ms since 1970\].
fn system_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}
