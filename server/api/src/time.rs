//! Conversion of times in messages, and the clock of the API.

use lightpath_proto::Timestamp;
use std::time::{SystemTime, UNIX_EPOCH};

/// Present time \[ms since 1970\].
pub(crate) fn now_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

pub(crate) fn timestamp(time_ms: i64) -> Timestamp {
    Timestamp { seconds: time_ms.div_euclid(1000), nanos: (time_ms.rem_euclid(1000) * 1_000_000) as i32 }
}

/// Converts a time \[ms since 1970\]; `None` if the message is not a valid time.
pub(crate) fn ms(time: &Timestamp) -> Option<i64> {
    let nanos = (0..1_000_000_000).contains(&time.nanos).then_some(i64::from(time.nanos))?;
    time.seconds.checked_mul(1000)?.checked_add(nanos / 1_000_000)
}
