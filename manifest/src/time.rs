//! Times in documents.

use chrono::{DateTime, Utc};
use std::fmt;

const FORMAT: &str = "%Y-%m-%dT%H:%M:%SZ";

/// A time in whole seconds of UTC, written as `2026-11-23T18:30:00Z`. All have the same length, so that their texts
/// have the order of the times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(DateTime<Utc>);

impl Time {
    /// The time this many seconds after the start of 1970. `None` before the year 1970 and beyond the year 9999, whose
    /// texts would have other lengths.
    #[must_use]
    pub fn from_unix_s(unix_s: i64) -> Option<Self> {
        let time = DateTime::from_timestamp(unix_s, 0)?;
        let is_written = (0..253_402_300_800).contains(&unix_s);
        is_written.then_some(Self(time))
    }

    /// Seconds since the start of 1970.
    #[must_use]
    pub fn unix_s(self) -> i64 {
        self.0.timestamp()
    }

    /// The time in a text; `None` for any other form than that of [`Self`].
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let time = chrono::NaiveDateTime::parse_from_str(text, FORMAT).ok()?;
        let time = Self::from_unix_s(time.and_utc().timestamp())?;
        (time.to_string() == text).then_some(time)
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.format(FORMAT))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_form_that_is_written_is_read() {
        let time = Time::from_unix_s(1_795_458_600).unwrap();
        assert_eq!(time.to_string(), "2026-11-23T18:30:00Z");
        assert_eq!(Time::parse("2026-11-23T18:30:00Z"), Some(time));
        for other in ["2026-11-23 18:30:00Z", "2026-11-23T18:30:60Z", "2026-2-3T18:30:00Z", "+2026-11-23T18:30:00Z", ""]
        {
            assert_eq!(Time::parse(other), None, "{other}");
        }
        assert_eq!(Time::from_unix_s(-1), None);
        assert_eq!(Time::from_unix_s(253_402_300_800), None);
    }
}
