//! The time that decides which documents count.

use lightpath_manifest::Time;
use std::fmt;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// Where an agent takes the time from. Tests give one that they move.
#[derive(Clone)]
pub struct Clock(Option<Arc<dyn Fn() -> Time + Send + Sync>>);

impl Clock {
    /// The device's clock.
    #[must_use]
    pub fn system() -> Self {
        Self::of(system_time)
    }

    /// A clock that says what a function returns.
    #[must_use]
    pub fn of(now: impl Fn() -> Time + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(now)))
    }

    /// No clock: the documents that the agent accepts say what time it is at least.
    #[must_use]
    pub fn none() -> Self {
        Self(None)
    }

    pub(crate) fn now(&self) -> Option<Time> {
        self.0.as_ref().map(|now| now())
    }
}

impl fmt::Debug for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Clock({:?})", self.now())
    }
}

/// The time of the device's clock, in whole seconds.
///
/// # Panics
///
/// Never: clocks beyond the year 9999 count as its last second.
pub(crate) fn system_time() -> Time {
    const LAST_UNIX_S: i64 = 253_402_300_799;
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let unix_s = i64::try_from(since).unwrap_or(LAST_UNIX_S).min(LAST_UNIX_S);
    Time::from_unix_s(unix_s).unwrap_or_else(|| unreachable!("the time is within its limits"))
}
