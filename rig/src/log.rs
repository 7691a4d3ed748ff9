//! Lines on stderr, one for each event.

use std::fmt;
use std::io::Write as _;

/// Writes a line. The system's journal adds the time.
pub(crate) fn line(text: impl fmt::Display) {
    // If stderr fails, the line cannot be written anywhere.
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
