//! Lines on stderr, one for each event.

use crate::clock::system_time;
use std::fmt;
use std::io::Write as _;

/// Writes a line with the time before it. What a server says is cut to printable characters before it gets here.
pub(crate) fn line(text: impl fmt::Display) {
    // If stderr fails, the line cannot be written anywhere.
    let _ = writeln!(std::io::stderr().lock(), "{} {text}", system_time());
}
