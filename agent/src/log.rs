//! Lines on stderr, one for each event.

use lightpath_manifest::Time;
use std::fmt;
use std::io::Write as _;
use std::time::{SystemTime, UNIX_EPOCH};

/// The present time in whole seconds.
///
/// # Panics
///
/// Never: clocks beyond the year 9999 count as its last second.
pub(crate) fn now() -> Time {
    const LAST_UNIX_S: i64 = 253_402_300_799;
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let unix_s = i64::try_from(since).unwrap_or(LAST_UNIX_S).min(LAST_UNIX_S);
    Time::from_unix_s(unix_s).unwrap_or_else(|| unreachable!("the time is within its limits"))
}

/// Writes a line with the time before it. What a server says is cut to printable characters before it gets here.
pub(crate) fn line(text: impl fmt::Display) {
    // If stderr fails, the line cannot be written anywhere.
    let _ = writeln!(std::io::stderr().lock(), "{} {text}", now());
}
