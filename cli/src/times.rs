//! Times and durations as command-line values.

use super::show::now_s;
use chrono::DateTime;

/// Parses a duration such as `45m` into seconds.
pub(crate) fn duration_s(text: &str) -> Result<f64, String> {
    let units = [("s", 1.0), ("m", 60.0), ("h", 3600.0), ("d", 86_400.0)];
    let split = units.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let value = split.and_then(|(number, unit)| Some(number.trim().parse::<f64>().ok()? * unit));
    value
        .filter(|seconds| *seconds > 0.0 && seconds.is_finite())
        .ok_or_else(|| "must be a number above 0 with its unit, s, m, h or d, such as 90s, 45m, 2h".to_owned())
}

/// Parses an exposure such as `20ms` into seconds.
pub(crate) fn exposure_s(text: &str) -> Result<f64, String> {
    let units = [("us", 1e-6), ("µs", 1e-6), ("ms", 1e-3), ("s", 1.0)];
    let split = units.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let value = split.and_then(|(number, unit)| Some(number.trim().parse::<f64>().ok()? * unit));
    value
        .filter(|seconds| *seconds > 0.0 && seconds.is_finite())
        .ok_or_else(|| "must be a number above 0 with its unit, us, ms or s, such as 20ms".to_owned())
}

/// Parses a time, or a duration from now, into seconds since 1970.
pub(crate) fn from_now(text: &str) -> Result<i64, String> {
    match duration_s(text) {
        Ok(duration_s) => Ok(now_s().saturating_add(duration_s.ceil() as i64)),
        Err(_) => time(text),
    }
}

/// Parses a time, or a duration before now, into seconds since 1970.
pub(crate) fn before_now(text: &str) -> Result<i64, String> {
    match duration_s(text) {
        Ok(duration_s) => Ok(now_s().saturating_sub(duration_s.ceil() as i64)),
        Err(_) => time(text),
    }
}

fn time(text: &str) -> Result<i64, String> {
    DateTime::parse_from_rfc3339(text).map(|time| time.timestamp()).map_err(|_| {
        "must be a time with its offset, such as 2026-11-21T22:00:00+01:00, or a duration, such as 90m".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_times_are_parsed() {
        assert_eq!(duration_s("90s"), Ok(90.0));
        assert_eq!(duration_s("1.5h"), Ok(5400.0));
        for bad in ["", "90", "0s", "-1m", "m", "infs", "NaNs"] {
            assert!(duration_s(bad).unwrap_err().contains("such as 90s"), "{bad}");
        }
        for parse in [from_now, before_now] {
            assert_eq!(parse("2026-11-21T22:00:00+01:00"), Ok(1_795_294_800));
            assert!(parse("tomorrow").unwrap_err().contains("such as 2026"));
        }
        assert_eq!(exposure_s("2.5ms"), Ok(0.0025));
        assert!(exposure_s("20").unwrap_err().contains("such as 20ms") && exposure_s("-1s").is_err());
        let now_s = now_s();
        assert!((119..=125).contains(&(from_now("2m").unwrap() - now_s)));
        assert!((115..=120).contains(&(now_s - before_now("2m").unwrap())));
    }
}
