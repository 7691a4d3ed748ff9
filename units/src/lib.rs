//! Lengths as text with units, such as `150mm`, `8um`, `515nm`. The client, the command line and the agent read them alike.
#![cfg_attr(test, allow(clippy::unwrap_used))]

use std::fmt;

/// A kind of length. It decides from which size on a number without a unit is refused, because its unit was probably
/// forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// Distance from the SLM to the image plane.
    Distance,
    /// Distance between the centres of neighbouring SLM pixels.
    PixelPitch,
    /// Wavelength in vacuum.
    Wavelength,
}

/// The reason why a text is not a length; the messages say what each means.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum ParseError {
    #[error("{length} \"{text}\" is not a number with a unit, such as {example}")]
    NotANumber { length: Length, text: String, example: &'static str },
    #[error("{length} is {text}, but must be a finite number, such as {example}")]
    NotFinite { length: Length, text: String, example: &'static str },
    #[error(
        "{length} \"{text}\" has the unknown unit \"{unit}\": use m, cm, mm, um (or µm), nm or pm, such as {example}"
    )]
    UnknownUnit { length: Length, text: String, unit: String, example: &'static str },
    /// The number has no unit. It would be in metres, and that is too large for this kind of length.
    #[error("{length} {text} has no unit and would be {metres} m: write {metres}{unit}")]
    NoUnit {
        length: Length,
        text: String,
        metres: String,
        /// The unit that the user probably meant.
        unit: &'static str,
    },
    /// `650e-6um` may be 650 µm of somebody who thought of metres.
    #[error(
        "{length} {text} has a power of ten and a unit, which make {shown}: write it without the power, such as {example}"
    )]
    PowerAndUnit { length: Length, text: String, shown: String, example: &'static str },
}

/// Units, each with its power of ten.
const UNITS: [(&str, i32); 8] =
    [("cm", -2), ("mm", -3), ("um", -6), ("µm", -6), ("μm", -6), ("nm", -9), ("pm", -12), ("m", 0)];

impl Length {
    /// Parses `150mm`, `8um`, `8µm`, `515nm`, `0.15m` or a plain number, and returns metres. A plain number is in
    /// metres.
    ///
    /// The result is the f64 nearest to the decimal number. The server checks its range.
    ///
    /// # Errors
    ///
    /// [`ParseError`] if the text is not a length, or if it is a plain number too large for this kind of length.
    pub fn parse_m(self, text: &str) -> Result<f64, ParseError> {
        let text = text.trim();
        let example = self.example();
        let not_a_number = || ParseError::NotANumber { length: self, text: text.to_owned(), example };
        if let Ok(plain) = text.parse::<f64>()
            && !plain.is_finite()
        {
            return Err(ParseError::NotFinite { length: self, text: text.to_owned(), example });
        }
        let (number, unit) = split_number(text).ok_or_else(not_a_number)?;
        if unit.is_empty() {
            return self.plain_m(text, number.parse().map_err(|_| not_a_number())?);
        }
        let Some((_, power)) = UNITS.iter().find(|(name, _)| *name == unit) else {
            let (text, unit) = (text.to_owned(), unit.to_owned());
            return Err(ParseError::UnknownUnit { length: self, text, unit, example });
        };
        let metres = with_power(number, *power).and_then(|decimal| decimal.parse::<f64>().ok());
        match metres {
            Some(metres) if metres.is_finite() && *power < 0 && number.contains(['e', 'E']) => {
                let (text, shown) = (text.to_owned(), format!("{metres:e} m"));
                Err(ParseError::PowerAndUnit { length: self, text, shown, example })
            }
            Some(metres) if metres.is_finite() => Ok(metres),
            Some(_) => Err(ParseError::NotFinite { length: self, text: text.to_owned(), example }),
            None => Err(not_a_number()),
        }
    }

    fn plain_m(self, text: &str, metres: f64) -> Result<f64, ParseError> {
        let (plain_max_m, unit) = match self {
            Self::Distance => (10.0, "mm"),
            Self::PixelPitch => (1e-2, "um"),
            Self::Wavelength => (1e-4, "nm"),
        };
        if metres.abs() > plain_max_m {
            // For example, 0.515 was probably meant in micrometres.
            let unit = if self == Self::Wavelength && metres.abs() < 10.0 { "um" } else { unit };
            return Err(ParseError::NoUnit { length: self, text: text.to_owned(), metres: metres.to_string(), unit });
        }
        Ok(metres)
    }

    fn example(self) -> &'static str {
        match self {
            Self::Distance => "150mm",
            Self::PixelPitch => "8um",
            Self::Wavelength => "515nm",
        }
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Distance => "distance",
            Self::PixelPitch => "pixel pitch",
            Self::Wavelength => "wavelength",
        })
    }
}

/// Formats a part of one for people, for example `7 %`, to a millionth of a per cent.
#[must_use]
pub fn show_percent(part: f64) -> String {
    format!("{} %", (part * 1e8).round() / 1e6)
}

/// Formats a length for people, for example `150 mm`, `8 µm` or `515 nm`, to a millionth of its unit.
#[must_use]
pub fn show_m(metres: f64) -> String {
    let (scale, unit) = match metres.abs() {
        size if size >= 1.0 || size == 0.0 || !size.is_finite() => (1.0, "m"),
        size if size >= 1e-3 => (1e3, "mm"),
        size if size >= 1e-6 => (1e6, "µm"),
        _ => (1e9, "nm"),
    };
    let number = format!("{:.6}", metres * scale);
    let number = if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
    format!("{number} {unit}")
}

/// Splits a text into the decimal number at its start, exponent included, and the rest without leading spaces.
fn split_number(text: &str) -> Option<(&str, &str)> {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let whole = digits(end);
    end += whole;
    let mut fraction = 0;
    if bytes.get(end) == Some(&b'.') {
        fraction = digits(end + 1);
        end += 1 + fraction;
    }
    if whole + fraction == 0 {
        return None;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = if bytes.len() > end + sign { digits(end + 1 + sign) } else { 0 };
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    Some((&text[..end], text[end..].trim_start()))
}

/// Multiplies a decimal text by 10^power, and returns a decimal text.
fn with_power(number: &str, power: i32) -> Option<String> {
    let (mantissa, exponent) = match number.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (number, 0),
    };
    Some(format!("{mantissa}e{}", exponent.checked_add(power)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_texts_are_parsed_exactly() {
        for (length, text, metres) in [
            (Length::Distance, "150mm", 0.15),
            (Length::Distance, "0.15m", 0.15),
            (Length::Distance, "0.15", 0.15),
            (Length::Distance, "15 cm", 0.15),
            (Length::Distance, "-12.5mm", -0.0125),
            (Length::Distance, "1.5e-1m", 0.15),
            (Length::Distance, "+.5m", 0.5),
            (Length::Distance, "5.", 5.0),
            (Length::Distance, "0mm", 0.0),
            (Length::PixelPitch, "8um", 8e-6),
            (Length::PixelPitch, "8µm", 8e-6),
            (Length::PixelPitch, "8μm", 8e-6),
            (Length::PixelPitch, "3.74um", 3.74e-6),
            (Length::PixelPitch, "8e-6", 8e-6),
            (Length::PixelPitch, "-8um", -8e-6),
            (Length::Wavelength, "515nm", 515e-9),
            (Length::Wavelength, "632.8nm", 632.8e-9),
            (Length::Wavelength, "515000pm", 515e-9),
            (Length::Wavelength, "0.515um", 515e-9),
        ] {
            assert_eq!(length.parse_m(text), Ok(metres), "{text}");
        }
    }

    #[test]
    fn powers_beside_units_are_questioned() {
        let refused = |length: Length, text: &str| length.parse_m(text).unwrap_err().to_string();
        assert_eq!(
            refused(Length::Wavelength, "650e-6um"),
            "wavelength 650e-6um has a power of ten and a unit, which make 6.5e-10 m: write it without the power, such as \
             515nm"
        );
        assert!(refused(Length::Distance, "1.5E2 mm").contains("which make 1.5e-1 m"));
    }

    #[test]
    fn error_names_forgotten_unit() {
        for (length, text, message) in [
            (Length::Distance, "150", "distance 150 has no unit and would be 150 m: write 150mm"),
            (Length::PixelPitch, "8", "pixel pitch 8 has no unit and would be 8 m: write 8um"),
            (Length::Wavelength, "515", "wavelength 515 has no unit and would be 515 m: write 515nm"),
            (Length::Wavelength, "0.515", "wavelength 0.515 has no unit and would be 0.515 m: write 0.515um"),
            (Length::Wavelength, "650e-3", "wavelength 650e-3 has no unit and would be 0.65 m: write 0.65um"),
        ] {
            assert_eq!(length.parse_m(text).unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn invalid_lengths_are_refused_with_an_example() {
        for (text, sign) in [
            ("", "not a number"),
            ("mm", "not a number"),
            ("-", "not a number"),
            (".mm", "not a number"),
            ("NaN", "finite"),
            ("inf", "finite"),
            ("1e999mm", "finite"),
            ("1e999999999999mm", "not a number"),
            ("150MM", "unknown unit \"MM\""),
            ("150mmm", "unknown unit \"mmm\""),
            ("1e", "unknown unit \"e\""),
            ("0x10", "unknown unit \"x10\""),
            ("1,5mm", "unknown unit"),
        ] {
            let error = Length::Distance.parse_m(text).unwrap_err().to_string();
            assert!(error.contains(sign) && error.contains("distance") && error.contains("150mm"), "{text}: {error}");
        }
    }

    #[test]
    fn lengths_are_shown_in_their_usual_unit() {
        for (metres, text) in [
            (0.15, "150 mm"),
            (-0.0125, "-12.5 mm"),
            (8e-6, "8 µm"),
            (3.74e-6, "3.74 µm"),
            (515e-9, "515 nm"),
            (632.8e-9, "632.8 nm"),
            (2.0, "2 m"),
            (10.0, "10 m"),
            (0.0, "0 m"),
        ] {
            assert_eq!(show_m(metres), text);
        }
    }
}
