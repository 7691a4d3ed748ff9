//! Diffraction orders of a display's pixels.

use super::order_filter::{FilterShape, OrderFilter};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Diffraction orders of the pixels that reach the image.
///
/// A grid of pixels repeats the spectrum of its hologram at multiples of 1/Δ, Δ the pixel pitch. Each repetition is an
/// order, and its light arrives λz/Δ beside the next one. Optics with a filter, such as a 4f relay with a stop, let the
/// first order through, the frequencies up to ½ cycle per pixel, or a part of it. Without a filter the image receives
/// the light of square pixels, with all orders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Orders {
    /// Only the first order, all of it.
    #[default]
    First,
    /// The part of the first order that a filter lets through.
    Filtered(OrderFilter),
    /// All orders of rectangular pixels.
    All {
        /// Side of a pixel's bright area along x, in pixel pitches.
        fill_factor_x: f64,
        /// Side of a pixel's bright area along y, in pixel pitches.
        fill_factor_y: f64,
    },
}

impl Orders {
    /// Smallest fill factor along an axis.
    pub const FILL_FACTOR_MIN: f64 = 0.1;

    /// All orders of square pixels without gaps.
    pub const SQUARE: Self = Self::All { fill_factor_x: 1.0, fill_factor_y: 1.0 };

    /// Checks the fill factors or the filter.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a fill factor that is not between [`Self::FILL_FACTOR_MIN`] and 1, and the errors of
    /// [`OrderFilter::validate`].
    pub fn validate(self) -> Result<()> {
        let (fill_factor_x, fill_factor_y) = match self {
            Self::First => return Ok(()),
            Self::Filtered(filter) => return filter.validate(),
            Self::All { fill_factor_x, fill_factor_y } => (fill_factor_x, fill_factor_y),
        };
        for (name, value) in [("fill_factor_x", fill_factor_x), ("fill_factor_y", fill_factor_y)] {
            if !(Self::FILL_FACTOR_MIN..=1.0).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed: "0.1 to 1" });
            }
        }
        Ok(())
    }

    /// Whether the image receives more than the first order.
    #[must_use]
    pub fn are_all(self) -> bool {
        matches!(self, Self::All { .. })
    }

    /// The filter, where one lets through a part of the first order.
    #[must_use]
    pub fn filter(self) -> Option<OrderFilter> {
        match self {
            Self::Filtered(filter) => Some(filter),
            Self::First | Self::All { .. } => None,
        }
    }
}

/// For example `all orders (fill factor 0.93×0.9)`.
impl fmt::Display for Orders {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => f.write_str("the whole first order"),
            Self::Filtered(OrderFilter { shape, width, height, centre_x, centre_y }) => {
                let shape = match shape {
                    FilterShape::Rectangle => "rectangular",
                    FilterShape::Ellipse => "elliptic",
                };
                write!(
                    f,
                    "the first order through a filter of {width}×{height} orders around {centre_x}, {centre_y} ({shape})"
                )
            }
            Self::All { fill_factor_x, fill_factor_y } => {
                write!(f, "all orders (fill factor {fill_factor_x}×{fill_factor_y})")
            }
        }
    }
}
