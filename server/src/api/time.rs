//! Times on the wire, and the clock of the API.

use pbjson_types::Timestamp;
use std::time::{SystemTime, UNIX_EPOCH};

/// Milliseconds since 1970.
pub(crate) fn now_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

pub(crate) fn timestamp(time_ms: i64) -> Timestamp {
    Timestamp { seconds: time_ms.div_euclid(1000), nanos: (time_ms.rem_euclid(1000) * 1_000_000) as i32 }
}
