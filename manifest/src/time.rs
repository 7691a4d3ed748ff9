//! Times in documents.

use chrono::{DateTime, Utc};
use std::fmt;

const FORMAT: &str = "%Y-%m-%dT%H:%M:%SZ";

/// A time in whole seconds of UTC, written as `2026-11-23T18:30:00Z`. All have the same length, so that their texts
/// have the order of the times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(DateTime<Utc>);

impl Time {
    /// The start of 1970, before which no document can have been issued.
    pub const EPOCH: Self = Self(DateTime::UNIX_EPOCH);

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

/// What a device knows of the present time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Now {
    /// It is this time.
    At(Time),
    /// It is this time or later, as for a device without a clock, which keeps the latest time that a document of its server
    /// was issued. Nothing is too new, and what ended by this time is too old.
    AtLeast(Time),
}

impl Now {
    /// The earliest time that it can be.
    #[must_use]
    pub fn earliest(self) -> Time {
        match self {
            Self::At(time) | Self::AtLeast(time) => time,
        }
    }

    /// The time for the check of a document that was issued at this time: without a clock, it is that time or later. So a
    /// stolen key cannot name a time after its own end, or after that of the keyring which lists it.
    pub(crate) fn not_before(self, issued: Time) -> Self {
        match self {
            Self::At(now) => Self::At(now),
            Self::AtLeast(earliest) => Self::AtLeast(earliest.max(issued)),
        }
    }

    /// Whether a time has certainly come.
    #[must_use]
    pub fn has_reached(self, time: Time) -> bool {
        self.earliest() >= time
    }

    /// Whether a time has certainly not come yet.
    #[must_use]
    pub fn is_before(self, time: Time) -> bool {
        matches!(self, Self::At(now) if now < time)
    }

    /// Whether something counts that counts from the first time to before the second.
    pub(crate) fn is_within(self, from: Time, until: Time) -> bool {
        !self.is_before(from) && !self.has_reached(until)
    }
}

impl From<Time> for Now {
    fn from(time: Time) -> Self {
        Self::At(time)
    }
}

impl fmt::Display for Now {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::At(time) => write!(f, "{time}"),
            Self::AtLeast(time) => write!(f, "{time} or later"),
        }
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
