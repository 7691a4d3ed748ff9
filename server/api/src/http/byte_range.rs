//! The part of a file that a request asks for (RFC 9110, section 14).

use axum::http::{HeaderMap, header};

/// What to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RangeOutcome {
    /// The whole file.
    Whole,
    /// The bytes from `first` to `last`.
    Part {
        /// First byte.
        first: u64,
        /// Last byte.
        last: u64,
    },
    /// Nothing: the range begins behind the end of the file.
    Unsatisfiable,
}

/// The range of a request. A field that is not one range of bytes, or an `If-Range` that names another file, means the
/// whole file.
pub(super) fn requested_range(headers: &HeaderMap, etag: &str, size_bytes: u64) -> RangeOutcome {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let Some(range) = text(header::RANGE).and_then(|range| range.strip_prefix("bytes=")) else {
        return RangeOutcome::Whole;
    };
    // A weak tag and a date do not say that all bytes are the same.
    if headers.contains_key(header::IF_RANGE) && text(header::IF_RANGE) != Some(etag) {
        return RangeOutcome::Whole;
    }
    let Some((first, last)) = range.trim().split_once('-') else { return RangeOutcome::Whole };
    let end = size_bytes.saturating_sub(1);
    match (number(first), number(last)) {
        (Some(first), _) if last.is_empty() && first < size_bytes => RangeOutcome::Part { first, last: end },
        (Some(first), Some(last)) if first <= last && first < size_bytes => {
            RangeOutcome::Part { first, last: last.min(end) }
        }
        (Some(first), Some(last)) if first > last => RangeOutcome::Whole,
        (Some(first), found) if first >= size_bytes && (last.is_empty() || found.is_some()) => {
            RangeOutcome::Unsatisfiable
        }
        (None, Some(0)) if first.is_empty() => RangeOutcome::Unsatisfiable,
        (None, Some(_)) if first.is_empty() && size_bytes == 0 => RangeOutcome::Unsatisfiable,
        (None, Some(count)) if first.is_empty() => {
            RangeOutcome::Part { first: size_bytes.saturating_sub(count), last: end }
        }
        _ => RangeOutcome::Whole,
    }
}

/// A number of digits alone. A number beyond all files counts as the largest one.
fn number(text: &str) -> Option<u64> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| text.parse().unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ETAG: &str = "\"sha256-0f\"";

    fn outcome(range: &str, if_range: Option<&str>, size_bytes: u64) -> RangeOutcome {
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, range.parse().unwrap());
        if_range.map(|tag| headers.insert(header::IF_RANGE, tag.parse().unwrap()));
        requested_range(&headers, ETAG, size_bytes)
    }

    #[test]
    fn ranges_are_read_as_the_standard_says() {
        use RangeOutcome::{Part, Unsatisfiable, Whole};
        for (range, expected) in [
            ("bytes=0-0", Part { first: 0, last: 0 }),
            ("bytes=10-", Part { first: 10, last: 99 }),
            ("bytes=10-19", Part { first: 10, last: 19 }),
            ("bytes=90-1000", Part { first: 90, last: 99 }),
            ("bytes=-10", Part { first: 90, last: 99 }),
            ("bytes=-1000", Part { first: 0, last: 99 }),
            ("bytes=0-99999999999999999999999", Part { first: 0, last: 99 }),
            ("bytes=100-", Unsatisfiable),
            ("bytes=100-200", Unsatisfiable),
            ("bytes=99999999999999999999999-", Unsatisfiable),
            ("bytes=-0", Unsatisfiable),
            ("bytes=20-10", Whole),
            ("bytes=0-1,5-6", Whole),
            ("bytes=a-b", Whole),
            ("bytes=-", Whole),
            ("bytes=+1-2", Whole),
            ("lines=1-2", Whole),
        ] {
            assert_eq!(outcome(range, None, 100), expected, "{range}");
        }
        assert_eq!(requested_range(&HeaderMap::new(), ETAG, 100), Whole);
        for empty in ["bytes=0-", "bytes=-5"] {
            assert_eq!(outcome(empty, None, 0), Unsatisfiable);
        }
    }

    #[test]
    fn range_of_another_file_means_the_whole_one() {
        assert_eq!(outcome("bytes=10-", Some(ETAG), 100), RangeOutcome::Part { first: 10, last: 99 });
        for other in ["\"sha256-ff\"", "W/\"sha256-0f\"", "Mon, 23 Nov 2026 18:00:00 GMT"] {
            assert_eq!(outcome("bytes=10-", Some(other), 100), RangeOutcome::Whole, "{other}");
        }
    }
}
