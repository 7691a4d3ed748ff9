//! Checks of requests, field by field. Every refusal names the path of the field and the allowed values.

use crate::error::{Fix, Result, ServiceError, WrongField};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::units::{Distance, Wavelength};
use std::fmt::{self, Display};
use std::ops::RangeInclusive;

/// The path of a field in a request, for example `spec.optimize_hologram.distance_m`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field(String);

impl Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Field {
    /// A field of the request itself.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self(name.to_owned())
    }

    /// Path of a field of this message.
    #[must_use]
    pub fn at(&self, name: &str) -> Self {
        Self(format!("{}.{name}", self.0))
    }

    /// Path of an element of this list.
    #[must_use]
    pub fn index(&self, i: usize) -> Self {
        Self(format!("{}[{i}]", self.0))
    }

    /// The error for a value that is not allowed, and what is: "`distance_m` is NaN, but must be …". `problem` continues
    /// after the name of the field.
    pub fn but(&self, problem: impl Display, allowed: impl Display) -> ServiceError {
        self.wrong(problem, Fix::Allowed(allowed.to_string()))
    }

    /// The error for a value that is not allowed, and what to do: "`phase` has no light; photograph it again".
    pub fn invalid(&self, problem: impl Display, action: impl Display) -> ServiceError {
        self.wrong(problem, Fix::Action(action.to_string()))
    }

    fn wrong(&self, problem: impl Display, fix: Fix) -> ServiceError {
        ServiceError::Invalid(WrongField { field: self.0.clone(), problem: problem.to_string(), fix })
    }

    /// The error for a field that names a missing resource; `fix` advises the client.
    pub fn missing(&self, what: impl Into<String>, fix: &'static str) -> ServiceError {
        ServiceError::Missing { field: self.0.clone(), what: what.into(), fix }
    }

    /// The value of a required field.
    pub fn required<T>(&self, value: Option<T>) -> Result<T> {
        value.ok_or_else(|| self.but("is not set", "is required"))
    }

    /// Checks a number, which must lie in the allowed range.
    pub fn number(&self, value: f64, allowed: RangeInclusive<f64>) -> Result<f64> {
        if allowed.contains(&value) {
            return Ok(value);
        }
        Err(self.but(format!("is {value}"), format!("must be {} to {}", allowed.start(), allowed.end())))
    }

    /// Checks a number, which must be above 0 and at most `most`.
    pub fn positive(&self, value: f64, most: f64) -> Result<f64> {
        if value > 0.0 && value <= most {
            return Ok(value);
        }
        Err(self.but(format!("is {value}"), format!("must be above 0 and at most {most}")))
    }

    /// Checks a number that may be left out, and then is `default`.
    pub fn number_or(&self, value: Option<f64>, default: f64, allowed: RangeInclusive<f64>) -> Result<f64> {
        let checked = self.if_set(value, format!("the default {default}"), |value| self.number(value, allowed))?;
        Ok(checked.unwrap_or(default))
    }

    /// Checks a whole number, which must lie in the allowed range.
    pub fn integer<T: PartialOrd + Display>(&self, value: T, allowed: RangeInclusive<T>) -> Result<T> {
        if allowed.contains(&value) {
            return Ok(value);
        }
        Err(self.but(format!("is {value}"), format!("must be {} to {}", allowed.start(), allowed.end())))
    }

    /// Checks a whole number that may be left out, and then is `default`.
    pub fn integer_or(&self, value: Option<u32>, default: u32, allowed: RangeInclusive<u32>) -> Result<u32> {
        let checked = self.if_set(value, format!("the default {default}"), |value| self.integer(value, allowed))?;
        Ok(checked.unwrap_or(default))
    }

    /// Checks the number of a version that may be left out. `unset` is what the request then means.
    pub fn version_if_set(&self, value: Option<u32>, unset: &str) -> Result<Option<u32>> {
        self.if_set(value, unset, |value| match value {
            0 => Err(self.but("is 0", "must be 1 or more")),
            version => Ok(version),
        })
    }

    /// Checks a value if it is given. The refusal of a 0 says also for what to leave it out: `unset`, such as `the default
    /// 50`. Clients that do not know of unset numbers send 0 for them.
    pub fn if_set<T: PartialEq + Default, R>(
        &self,
        value: Option<T>,
        unset: impl Display,
        check: impl FnOnce(T) -> Result<R>,
    ) -> Result<Option<R>> {
        let is_zero = value.as_ref().is_some_and(|value| *value == T::default());
        let checked = value.map(check).transpose();
        checked.map_err(|error| match error {
            ServiceError::Invalid(WrongField { problem, fix: Fix::Allowed(allowed), .. }) if is_zero => {
                self.but(problem, format!("{allowed}; leave it out for {unset}"))
            }
            other => other,
        })
    }

    /// Checks the length of a text.
    pub fn text(&self, value: String, bytes_max: usize) -> Result<String> {
        if value.len() > bytes_max {
            return Err(self.but(format!("has {} bytes", value.len()), format!("at most {bytes_max} are accepted")));
        }
        Ok(value)
    }

    /// Checks a text for people that stands in one line, without characters that a terminal obeys.
    pub fn line(&self, value: String, bytes_max: usize) -> Result<String> {
        if let Some(found) = value.chars().find(|&character| is_unshown(character)) {
            let problem = format!("has the control character {}", found.escape_unicode());
            return Err(self.invalid(problem, "write one line of plain text"));
        }
        self.text(value, bytes_max)
    }

    /// Checks a text for people that may have several lines, without characters that a terminal obeys.
    pub fn lines(&self, value: String, bytes_max: usize) -> Result<String> {
        let is_allowed = |character| matches!(character, '\n' | '\t');
        if let Some(found) = value.chars().find(|&character| is_unshown(character) && !is_allowed(character)) {
            let problem = format!("has the control character {}", found.escape_unicode());
            return Err(self.invalid(problem, "write plain text"));
        }
        self.text(value, bytes_max)
    }

    /// Checks the name of a format of kernels' files.
    pub fn kernel_format(&self, name: &str) -> Result<KernelFormat> {
        KernelFormat::parse(name).ok_or_else(|| {
            let formats: Vec<&str> = KernelFormat::ALL.iter().map(|format| format.as_str()).collect();
            self.but(format!("is {:?}", shortened(name)), format!("must be one of {}", formats.join(", ")))
        })
    }

    /// Checks a distance \[m\].
    pub fn distance(&self, value: f64) -> Result<Distance> {
        let allowed = format!("within ±{} m and not 0", Distance::MAX_M);
        Distance::from_m(value).ok_or_else(|| self.but(format!("is {value}"), format!("must be {allowed}")))
    }

    /// Checks a wavelength \[m\].
    pub fn wavelength(&self, value: f64) -> Result<Wavelength> {
        let allowed = format!("{:e} to {:e} m", Wavelength::MIN_M, Wavelength::MAX_M);
        Wavelength::from_m(value).ok_or_else(|| self.but(format!("is {value}"), format!("must be {allowed}")))
    }

    /// Checks a wavelength \[m\], which must be one of the display's. It may be left out if the display has only one.
    pub fn wavelength_of(
        &self,
        value: Option<f64>,
        display: &lightpath_domain::display::Display,
    ) -> Result<Wavelength> {
        let list = || display.wavelengths.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let name = format!("displays/{}", display.id);
        let Some(value) = value else {
            let [only] = display.wavelengths[..] else {
                return Err(self.invalid(
                    format!("is not given, but {name} has several wavelengths"),
                    format!("give one of {}", list()),
                ));
            };
            return Ok(only);
        };
        if value == 0.0 {
            let rule = match &display.wavelengths[..] {
                [only] => format!("must be {only}, the wavelength of {name}; leave it out for this one"),
                _ => format!("must be one of {}, the wavelengths of {name}", list()),
            };
            return Err(self.but("is 0", rule));
        }
        let wavelength = self.wavelength(value)?;
        if !display.wavelengths.contains(&wavelength) {
            let rule = format!("must be one of {}, the wavelengths of {name}", list());
            return Err(self.but(format!("is {wavelength}"), rule));
        }
        Ok(wavelength)
    }

    /// Checks the digest of an artifact: `sha256-` and 64 hexadecimal digits.
    pub fn digest(&self, value: &str) -> Result<String> {
        let is_digest = value.strip_prefix("sha256-").is_some_and(|hex| {
            hex.len() == 64 && hex.bytes().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
        });
        if is_digest {
            return Ok(value.to_owned());
        }
        let shown = if value.is_empty() { "empty".to_owned() } else { format!("{:?}", shortened(value)) };
        Err(self
            .but(format!("is {shown}"), "must be an artifact's digest: sha256- and 64 lower-case hexadecimal digits"))
    }
}

/// The start of a text, long enough to recognize the text in a message.
#[must_use]
pub fn shortened(text: &str) -> &str {
    const CHARACTERS_MAX: usize = 80;
    text.char_indices().nth(CHARACTERS_MAX).map_or(text, |(end, _)| &text[..end])
}

/// Whether a terminal obeys a character instead of showing it: control characters, line separators, and marks that turn
/// the direction of writing.
fn is_unshown(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_for_people_have_nothing_that_a_terminal_obeys() {
        let field = Field::new("notes");
        assert_eq!(field.lines("two\nlines, ä 😀".to_owned(), 99).unwrap(), "two\nlines, ä 😀");
        let broken = field.line("two\nlines".to_owned(), 99).unwrap_err().to_string();
        assert_eq!(broken, "notes has the control character \\u{a}; write one line of plain text");
        for bad in ['\u{1b}', '\r', '\u{9b}', '\u{202e}', '\u{2067}', '\u{200f}', '\u{2028}', '\u{61c}'] {
            let text = format!("a{bad}b");
            assert!(field.line(text.clone(), 99).is_err() && field.lines(text, 99).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn refusals_name_the_field_and_the_allowed_values() {
        let spec = Field::new("spec").at("optimize_hologram");
        let message = spec.at("distance_m").distance(f64::NAN).unwrap_err().to_string();
        assert_eq!(message, "spec.optimize_hologram.distance_m is NaN, but must be within ±10 m and not 0");
        let message = Field::new("display").at("pixel_pitch_m").number(-1.0, 1e-7..=1e-3).unwrap_err().to_string();
        assert_eq!(message, "display.pixel_pitch_m is -1, but must be 0.0000001 to 0.001");
        let message = Field::new("pair").at("phase").digest("").unwrap_err().to_string();
        assert!(message.starts_with("pair.phase is empty, but must be an artifact"), "{message}");
    }

    #[test]
    fn malformed_digests_are_refused() {
        let field = Field::new("digest");
        let good = format!("sha256-{}", "0a".repeat(32));
        assert_eq!(field.digest(&good).unwrap(), good);
        for bad in [good.to_uppercase(), good[..70].to_owned(), format!("{good}0"), good.replace("sha256-", "")] {
            assert!(field.digest(&bad).is_err(), "{bad}");
        }
        assert!(field.digest("sha256-../../../../../../../../../../../etc/passwd-------------------").is_err());
    }

    #[test]
    fn numbers_outside_the_range_are_refused() {
        let field = Field::new("x");
        for bad in [f64::NAN, f64::INFINITY, -0.1, 1.1] {
            assert!(field.number(bad, 0.0..=1.0).is_err());
        }
        assert_eq!(field.number_or(None, 0.3, 0.1..=1.0).unwrap(), 0.3);
        assert!(field.number_or(Some(f64::NAN), 0.3, 0.1..=1.0).is_err());
        for bad in [f64::NAN, 0.0, -0.1, 1.1] {
            assert!(field.positive(bad, 1.0).is_err());
        }
    }

    #[test]
    fn zero_stands_for_no_default_and_refusals_say_to_leave_it_out() {
        let field = Field::new("x");
        let refusal = |result: Result<String>| result.unwrap_err().to_string();
        let number = refusal(field.number_or(Some(0.0), 0.3, 0.1..=1.0).map(|x| x.to_string()));
        assert_eq!(number, "x is 0, but must be 0.1 to 1; leave it out for the default 0.3");
        let integer = refusal(field.integer_or(Some(0), 50, 1..=1000).map(|x| x.to_string()));
        assert_eq!(integer, "x is 0, but must be 1 to 1000; leave it out for the default 50");
        let large = refusal(field.integer_or(Some(1001), 50, 1..=1000).map(|x| x.to_string()));
        assert_eq!(large, "x is 1001, but must be 1 to 1000");
        let version = refusal(field.version_if_set(Some(0), "no version").map(|x| format!("{x:?}")));
        assert_eq!(version, "x is 0, but must be 1 or more; leave it out for no version");
        assert_eq!(field.version_if_set(None, "no version").unwrap(), None);
    }
}
