//! Exact lengths: distances and wavelengths as whole numbers, because floating-point numbers are unsafe as keys.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Wavelength in vacuum, in whole picometres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Wavelength {
    /// Wavelength \[pm\].
    pub pm: i64,
}

/// Distance from the SLM, in whole nanometres. Negative distances are behind the SLM.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Distance {
    /// Distance \[nm\].
    pub nm: i64,
}

impl Wavelength {
    /// Shortest accepted wavelength \[m\].
    pub const MIN_M: f64 = 200e-9;
    /// Longest accepted wavelength \[m\].
    pub const MAX_M: f64 = 2e-6;

    /// Rounds to the nearest picometre; `None` if `wavelength_m` is not between [`Self::MIN_M`] and [`Self::MAX_M`].
    #[must_use]
    pub fn from_m(wavelength_m: f64) -> Option<Self> {
        (Self::MIN_M..=Self::MAX_M).contains(&wavelength_m).then(|| Self { pm: (wavelength_m * 1e12).round() as i64 })
    }

    /// Wavelength \[m\].
    #[must_use]
    pub fn m(self) -> f64 {
        self.pm as f64 / 1e12
    }

    /// Parses a wavelength such as `632.8nm`; `None` if it is not exact or not between [`Self::MIN_M`] and
    /// [`Self::MAX_M`].
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let pm = read_thousandths(text, 1_000, "nm")?;
        Self::from_m(pm as f64 / 1e12)
    }
}

impl Distance {
    /// Largest accepted magnitude of a distance \[m\].
    pub const MAX_M: f64 = 10.0;

    /// Rounds to the nearest nanometre; `None` if `distance_m` is not within ±[`Self::MAX_M`] or rounds to 0.
    #[must_use]
    pub fn from_m(distance_m: f64) -> Option<Self> {
        if !(-Self::MAX_M..=Self::MAX_M).contains(&distance_m) {
            return None;
        }
        let nm = (distance_m * 1e9).round() as i64;
        (nm != 0).then_some(Self { nm })
    }

    /// Distance \[m\].
    #[must_use]
    pub fn m(self) -> f64 {
        self.nm as f64 / 1e9
    }

    /// Parses a distance such as `-12.5mm`; `None` if it is not exact, not within ±[`Self::MAX_M`] or 0.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let nm = read_thousandths(text, 1_000_000, "mm")?;
        Self::from_m(nm as f64 / 1e9)
    }
}

/// Displays the wavelength as in kernel names: `515nm`, `632.8nm`.
impl fmt::Display for Wavelength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_thousandths(f, self.pm, 1_000, "nm")
    }
}

/// Displays the distance as in kernel names: `150mm`, `-12.5mm`.
impl fmt::Display for Distance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_thousandths(f, self.nm, 1_000_000, "mm")
    }
}

fn write_thousandths(f: &mut fmt::Formatter<'_>, value: i64, per_unit: i64, unit: &str) -> fmt::Result {
    let sign = if value < 0 { "-" } else { "" };
    let (whole, rest) = (value.abs() / per_unit, value.abs() % per_unit);
    if rest == 0 {
        return write!(f, "{sign}{whole}{unit}");
    }
    let digits = per_unit.ilog10() as usize;
    let fraction = format!("{rest:0digits$}");
    write!(f, "{sign}{whole}.{}{unit}", fraction.trim_end_matches('0'))
}

/// Parses the output of [`write_thousandths`]; `None` for any other text, such as one with digits below the resolution.
fn read_thousandths(text: &str, per_unit: i64, unit: &str) -> Option<i64> {
    /// Limit on the digits before the decimal point: enough for every length here, and few enough to avoid an overflow.
    const WHOLE_DIGITS_MAX: usize = 9;
    let number = text.strip_suffix(unit)?;
    let (negative, number) = number.strip_prefix('-').map_or((false, number), |rest| (true, rest));
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    let digits = per_unit.ilog10() as usize;
    let all_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if !all_digits(whole) || !all_digits(fraction) || whole.len() > WHOLE_DIGITS_MAX || fraction.len() > digits {
        return None;
    }
    let value = whole.parse::<i64>().ok()? * per_unit + format!("{fraction:0<digits$}").parse::<i64>().ok()?;
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_written_exactly_and_without_trailing_zeros() {
        assert_eq!(Wavelength::from_m(515e-9).unwrap().to_string(), "515nm");
        assert_eq!(Wavelength::from_m(632.8e-9).unwrap().to_string(), "632.8nm");
        assert_eq!(Distance::from_m(0.15).unwrap().to_string(), "150mm");
        assert_eq!(Distance::from_m(-0.0125).unwrap().to_string(), "-12.5mm");
        assert_eq!(Distance::from_m(1e-9).unwrap().to_string(), "0.000001mm");
    }

    #[test]
    fn written_lengths_are_read_back_exactly() {
        for pm in [200_000, 514_999, 515_000, 632_816, 2_000_000] {
            assert_eq!(Wavelength::parse(&Wavelength { pm }.to_string()), Some(Wavelength { pm }));
        }
        for nm in [1, -1, 150_000_000, -12_500_000, 9_999_999_999, 10_000_000_000] {
            assert_eq!(Distance::parse(&Distance { nm }.to_string()), Some(Distance { nm }));
        }
        for bad in ["", "mm", "1", "1 mm", "1.0000001mm", "+1mm", "--1mm", "0mm", "10001mm", "9999999999999999mm"] {
            assert_eq!(Distance::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn impossible_lengths_are_refused() {
        for bad in [f64::NAN, f64::INFINITY, 0.0, 1e-10, 11.0, -11.0] {
            assert_eq!(Distance::from_m(bad), None, "{bad}");
        }
        for bad in [f64::NAN, -515e-9, 0.0, 1e-10, 1.0] {
            assert_eq!(Wavelength::from_m(bad), None, "{bad}");
        }
    }
}
