//! Diffraction orders of a display's pixels.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Diffraction orders of the pixels that reach the image.
///
/// A grid of pixels repeats the spectrum of its hologram at multiples of 1/Δ, Δ the pixel pitch. Each repetition is an
/// order, and its light arrives λz/Δ beside the next one. Optics with a filter, such as a 4f relay with a stop, let the
/// first order through: the frequencies up to ½ cycle per pixel. Without a filter the image receives the light of square
/// pixels, with all orders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Orders {
    /// Only the first order.
    #[default]
    First,
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

    /// Checks the fill factors.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a fill factor that is not between [`Self::FILL_FACTOR_MIN`] and 1.
    pub fn validate(self) -> Result<()> {
        let Self::All { fill_factor_x, fill_factor_y } = self else { return Ok(()) };
        for (name, value) in [("fill_factor_x", fill_factor_x), ("fill_factor_y", fill_factor_y)] {
            if !(Self::FILL_FACTOR_MIN..=1.0).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed: "0.1 to 1" });
            }
        }
        Ok(())
    }
}
