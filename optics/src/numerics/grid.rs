//! Sampling grids and the exact frequencies of their Fourier transforms.

use crate::error::{Error, Result};

/// Grid of samples on a plane: its size and the distance between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    height_px: usize,
    width_px: usize,
    pixel_pitch_m: f64,
}

impl Grid {
    /// Largest number of pixels along one axis.
    pub const SIDE_PX_MAX: usize = 16_384;

    /// Creates a grid of `height_px` × `width_px` samples with a distance of `pixel_pitch_m` \[m\] between neighbours.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a side of 0 or beyond [`Self::SIDE_PX_MAX`], or a pitch that is not between
    /// 10 nm and 10 mm.
    pub fn try_new(height_px: usize, width_px: usize, pixel_pitch_m: f64) -> Result<Self> {
        for (name, side_px) in [("height_px", height_px), ("width_px", width_px)] {
            if side_px == 0 || side_px > Self::SIDE_PX_MAX {
                return Err(Error::OutOfRange { name, value: side_px as f64, allowed: "1 to 16384 px" });
            }
        }
        if !(1e-8..=1e-2).contains(&pixel_pitch_m) {
            return Err(Error::OutOfRange { name: "pixel_pitch_m", value: pixel_pitch_m, allowed: "1e-8 to 1e-2 m" });
        }
        Ok(Self { height_px, width_px, pixel_pitch_m })
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Distance between neighbouring samples \[m\].
    #[must_use]
    pub fn pixel_pitch_m(&self) -> f64 {
        self.pixel_pitch_m
    }

    /// Number of samples.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.height_px * self.width_px
    }
}

/// Frequency \[1/m\] of bin `bin` of a DFT of `bins` samples at a distance of Δ = `pixel_pitch_m`: bin/(bins·Δ), with
/// the upper half of the bins wrapped to negative frequencies.
///
/// ```
/// use lightpath_optics::numerics::grid::frequency;
/// assert_eq!(frequency(1, 4, 0.5), 0.5);
/// assert_eq!(frequency(2, 4, 0.5), -1.0);
/// assert_eq!(frequency(4, 5, 0.5), -0.4);
/// ```
#[must_use]
pub fn frequency(bin: usize, bins: usize, pixel_pitch_m: f64) -> f64 {
    let signed = if bin < bins.div_ceil(2) { bin as f64 } else { bin as f64 - bins as f64 };
    signed / (bins as f64 * pixel_pitch_m)
}
