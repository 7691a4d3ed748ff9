//! Times, lengths, sizes and numbers as text.

use chrono::DateTime;
use lightpath::v1::{Measure, Place, UsedKernel};
use lightpath::{names, units};
use std::time::{SystemTime, UNIX_EPOCH};

/// A time, for example `2026-11-20 14:07:49 UTC (3 min ago)`.
pub(crate) fn time(time: &pbjson_types::Timestamp) -> String {
    format!("{} ({})", clock(time.seconds), age(time))
}

/// A time, for example `2026-11-20 14:07:49 UTC (3 min ago)`. `–` if there is none.
pub(crate) fn time_or_dash(some: Option<&pbjson_types::Timestamp>) -> String {
    some.map_or_else(|| "–".to_owned(), time)
}

/// A time, for example `2026-11-20 14:07:49 UTC`. `–` if there is none.
pub(crate) fn clock_or_dash(some: Option<&pbjson_types::Timestamp>) -> String {
    some.map_or_else(|| "–".to_owned(), |time| clock(time.seconds))
}

/// The age of a time, for example `3 min ago`. `–` if there is none.
pub(crate) fn age_or_dash(some: Option<&pbjson_types::Timestamp>) -> String {
    some.map_or_else(|| "–".to_owned(), age)
}

/// A number with its word, such as `1 problem` or `no warnings`.
pub(crate) fn counted(count: usize, word: &str) -> String {
    match count {
        0 => format!("no {word}s"),
        1 => format!("1 {word}"),
        many => format!("{many} {word}s"),
    }
}

/// A text of somebody else in one line, without characters that could change what the terminal shows.
pub(crate) fn plain(text: &str) -> String {
    text.replace(is_unshown, "\u{fffd}")
}

/// The same for a text that may have several lines.
pub(crate) fn plain_lines(text: &str) -> String {
    text.replace(|character| character != '\n' && is_unshown(character), "\u{fffd}")
}

/// Whether a terminal obeys a character instead of showing it: control characters, line separators, and marks that turn
/// the direction of writing.
fn is_unshown(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The age of a time, for example `3 min ago`.
pub(crate) fn age(time: &pbjson_types::Timestamp) -> String {
    age_between(time.seconds, now_s())
}

/// The time between two moments, for example `12.3 s` or `4 min 10 s`. `None` unless both are known.
pub(crate) fn elapsed(from: Option<&pbjson_types::Timestamp>, to: Option<&pbjson_types::Timestamp>) -> Option<String> {
    let seconds = |time: &pbjson_types::Timestamp| time.seconds as f64 + f64::from(time.nanos) / 1e9;
    Some(duration(seconds(to?) - seconds(from?)))
}

/// A duration, for example `0.4 s`, `12.3 s`, `4 min 10 s` or `2 h 5 min`.
pub(crate) fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match whole {
        0..60 => format!("{:.1} s", seconds.max(0.0)),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// A rough duration, for example `40 s`, `3 min` or `2 h 5 min`.
pub(crate) fn about(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole, (whole + 30) / 60) {
        (0..60, _) => format!("{whole} s"),
        (_, minutes @ 0..60) => format!("{minutes} min"),
        (_, minutes) => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

/// A ratio in decibels, for example `46.3 dB`.
pub(crate) fn decibel(value: f64) -> String {
    format!("{value:.1} dB")
}

/// A ratio in decibels with one standard deviation if it is known, for example `40.3 ± 1.5 dB`.
pub(crate) fn measured_decibel(measure: Measure) -> String {
    match measure.std {
        // A smaller deviation would be shown as 0.0.
        Some(std) if std >= 0.05 => format!("{:.1} ± {std:.1} dB", measure.value),
        _ => decibel(measure.value),
    }
}

/// A loss: with five decimals, or in scientific notation below 0.001.
pub(crate) fn loss(value: f64) -> String {
    if value == 0.0 || value.abs() >= 1e-3 { format!("{value:.5}") } else { format!("{value:.2e}") }
}

/// A size, for example `512 B`, `3.1 kB` or `66.4 MB`.
pub(crate) fn bytes(size: u64) -> String {
    let (mut value, mut unit) = (size as f64, "B");
    for next in ["kB", "MB", "GB", "TB"] {
        if value < 1000.0 {
            break;
        }
        (value, unit) = (value / 1000.0, next);
    }
    if unit == "B" { format!("{size} B") } else { format!("{value:.1} {unit}") }
}

/// Wavelength and place, for example `515 nm, 150 mm`.
pub(crate) fn optics(wavelength_m: f64, place: Option<&Place>) -> String {
    format!("{}, {}", units::show_m(wavelength_m), self::place(place))
}

/// A place, for example `150 mm`. Places of kinds that this program does not know are `–`.
pub(crate) fn place(place: Option<&Place>) -> String {
    place.and_then(Place::distance_m).map_or_else(|| "–".to_owned(), units::show_m)
}

/// Places separated by commas, for example `140 mm, 160 mm`.
pub(crate) fn places<'a>(places: impl IntoIterator<Item = Option<&'a Place>>) -> String {
    places.into_iter().map(place).collect::<Vec<_>>().join(", ")
}

/// Lengths separated by commas, for example `450 nm, 520 nm`.
pub(crate) fn lengths(metres: impl IntoIterator<Item = f64>) -> String {
    metres.into_iter().map(units::show_m).collect::<Vec<_>>().join(", ")
}

/// A kernel version, for example `version 3`.
pub(crate) fn kernel_version(version: u32) -> String {
    format!("version {version}")
}

/// The versions of used kernels, for example `version 3, ideal, version 1`. Equal versions are shown once, and an empty list
/// is `–`.
pub(crate) fn used_kernels(kernels: &[UsedKernel]) -> String {
    let version = |kernel: &UsedKernel| match kernel.kernel_version.as_str() {
        "" => "ideal".to_owned(),
        name => format!("version {}", names::id(name)),
    };
    let mut versions: Vec<String> = kernels.iter().map(version).collect();
    if versions.windows(2).all(|pair| pair[0] == pair[1]) {
        versions.truncate(1);
    }
    if versions.is_empty() { "–".to_owned() } else { versions.join(", ") }
}

/// A text, or `–` if it is empty.
pub(crate) fn or_dash(text: &str) -> String {
    if text.is_empty() { "–".to_owned() } else { text.to_owned() }
}

/// The number of a version or attempt, for example `3`. `–`: none.
pub(crate) fn version_or_dash(number: Option<u32>) -> String {
    number.map_or_else(|| "–".to_owned(), |number| number.to_string())
}

/// The time \[s since 1970\].
pub(crate) fn now_s() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs() as i64)
}

fn clock(seconds: i64) -> String {
    match DateTime::from_timestamp(seconds, 0) {
        Some(time) => time.format("%Y-%m-%d %H:%M:%S UTC").to_string(),
        None => format!("{seconds} s after 1970"),
    }
}

fn age_between(then_s: i64, now_s: i64) -> String {
    let distance = now_s.saturating_sub(then_s);
    let length = match distance.unsigned_abs() {
        0..2 => return "now".to_owned(),
        seconds @ 2..90 => format!("{seconds} s"),
        seconds @ 90..5400 => format!("{} min", (seconds + 30) / 60),
        seconds @ 5400..129_600 => format!("{} h", (seconds + 1800) / 3600),
        seconds => format!("{} days", (seconds + 43_200) / 86_400),
    };
    if distance > 0 { format!("{length} ago") } else { format!("in {length}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_obeys_nothing_that_somebody_else_wrote() {
        let hostile = "red\u{1b}[31m\u{9b}2J\rover\u{202e}gnp.exe\u{2066}\u{200f}\u{2028}end\tä 😀";
        let shown = "red\u{fffd}[31m\u{fffd}2J\u{fffd}over\u{fffd}gnp.exe\u{fffd}\u{fffd}\u{fffd}end\u{fffd}ä 😀";
        assert_eq!(plain(hostile), shown);
        assert_eq!(plain("two\nlines"), "two\u{fffd}lines");
        assert_eq!(plain_lines(&format!("one\n{hostile}")), format!("one\n{shown}"));
    }

    #[test]
    fn ages_have_one_unit() {
        for (distance, text) in [
            (0, "now"),
            (42, "42 s ago"),
            (180, "3 min ago"),
            (7200, "2 h ago"),
            (259_200, "3 days ago"),
            (-30, "in 30 s"),
        ] {
            assert_eq!(age_between(1_000_000, 1_000_000 + distance), text);
        }
        assert_eq!(clock(1_795_000_069), "2026-11-18 11:07:49 UTC");
    }

    #[test]
    fn numbers_have_units() {
        assert_eq!(decibel(46.27), "46.3 dB");
        assert_eq!(bytes(512), "512 B");
        assert_eq!(bytes(66_400_000), "66.4 MB");
        assert_eq!(duration(250.4), "4 min 10 s");
        assert_eq!(duration(0.42), "0.4 s");
        assert_eq!(loss(0.00139), "0.00139");
        assert_eq!(loss(0.0001), "1.00e-4");
        let used = |versions: &[&str]| {
            let kernel = |&version: &&str| UsedKernel { kernel_version: version.to_owned(), ..Default::default() };
            used_kernels(&versions.iter().map(kernel).collect::<Vec<_>>())
        };
        let third = "displays/lab/kernels/515nm-150mm/versions/3";
        assert_eq!(used(&[""]), "ideal");
        assert_eq!((used(&[third, third]), used(&[])), ("version 3".into(), "–".into()));
        assert_eq!(used(&[third, ""]), "version 3, ideal");
    }
}
