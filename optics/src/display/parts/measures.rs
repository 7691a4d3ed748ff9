//! How strong a part is: what is measured, in which unit, and how it is told to people.

use serde::{Deserialize, Serialize};

/// Unit of a measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Radians.
    #[serde(rename = "rad")]
    Radians,
    /// Pixels.
    #[serde(rename = "px")]
    Pixels,
    /// A part of one, which people read in percent.
    #[serde(rename = "fraction")]
    Fraction,
    /// None: a plain number, such as a degree.
    #[serde(rename = "1")]
    One,
}

impl Unit {
    /// Name of the unit as it is stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Radians => "rad",
            Self::Pixels => "px",
            Self::Fraction => "fraction",
            Self::One => "1",
        }
    }
}

/// What tells how strong a part is.
pub(crate) struct Measures {
    /// The strength in words, with `{}` in place of each measure in turn.
    pub(crate) phrase: &'static str,
    pub(crate) scales: &'static [Scale],
    /// What people should know besides; empty for nothing.
    pub(crate) note: &'static str,
}

/// Where a number that tells how strong a part is can be read.
pub(crate) struct Scale {
    /// Name as it is stored.
    pub(crate) name: &'static str,
    pub(crate) unit: Unit,
    /// Decimal places for people, if nothing says how certain the number is.
    pub(crate) digits: usize,
}

/// Largest number of decimal places.
const DIGITS_MAX: usize = 4;

impl Scale {
    /// A value with its unit for people, with one standard deviation if it is known. Without one it has some more
    /// decimal places than usual.
    pub(crate) fn text(&self, value: f64, std: Option<f64>, more_digits: usize) -> String {
        let (factor, unit) = match self.unit {
            Unit::Radians => (1.0, " rad"),
            Unit::Pixels => (1.0, " px"),
            Unit::Fraction => (100.0, " %"),
            // A plain number is counted, and has no more digits.
            Unit::One => return format!("{value:.0}"),
        };
        let value = factor * value;
        let Some(std) = std.map(|std| factor * std) else {
            let digits = self.digits + more_digits;
            return format!("{value:.digits$}{unit}");
        };
        // As many digits as a small deviation needs.
        let digits = (self.digits..self.digits + 2).find(|&digits| std >= 0.5 * 0.1f64.powi(digits as i32));
        let digits = digits.unwrap_or(DIGITS_MAX);
        format!("{value:.digits$} ± {std:.digits$}{unit}")
    }
}

/// Gives the standard deviation of a number from its slopes by the numbers that its part has in θ.
pub(crate) type Deviation<'a> = &'a dyn Fn(&[f64]) -> f64;
/// Gives the measures of the strongest part that photographs could hide, from the largest change of a number that they
/// could hide.
pub(crate) type Hidden = fn(Deviation<'_>) -> Vec<f64>;
