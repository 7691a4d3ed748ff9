//! Windows: sampled rectangles of the image plane in which a field is computed.

use crate::error::{Error, Result};
use crate::numerics::Grid;
use serde::{Deserialize, Serialize};

/// Sampled rectangle of the image plane, with any distance between samples and any centre.
///
/// Column `x` lies at centre_x_m + (x − (width_px − 1)/2) · pitch_x_m, row `y` at centre_y_m + (y − (height_px − 1)/2)
/// · pitch_y_m. The origin is opposite the middle of the display, which lies between pixels if their number is even.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageWindow {
    height_px: usize,
    width_px: usize,
    pitch_x_m: f64,
    pitch_y_m: f64,
    centre_x_m: f64,
    centre_y_m: f64,
}

impl ImageWindow {
    /// Largest distance of a window's centre from the axis, along x or y \[m\]. It equals the largest distance of an
    /// image.
    pub const CENTRE_M_MAX: f64 = 10.0;

    /// Window with square pixels, centred on the axis.
    ///
    /// # Errors
    ///
    /// The errors of [`Grid::try_new`].
    pub fn try_new(height_px: usize, width_px: usize, pixel_pitch_m: f64) -> Result<Self> {
        Ok(Self::of(&Grid::try_new(height_px, width_px, pixel_pitch_m)?))
    }

    /// Window with the size and pitch of the display's pixels, centred on the axis.
    #[must_use]
    pub fn of(grid: &Grid) -> Self {
        let (pitch_m, height_px, width_px) = (grid.pixel_pitch_m(), grid.height_px(), grid.width_px());
        Self { height_px, width_px, pitch_x_m: pitch_m, pitch_y_m: pitch_m, centre_x_m: 0.0, centre_y_m: 0.0 }
    }

    /// Moves the window's centre to (`centre_x_m`, `centre_y_m`) \[m\] from the axis.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a centre farther away than [`Self::CENTRE_M_MAX`].
    pub fn centred_at(self, centre_x_m: f64, centre_y_m: f64) -> Result<Self> {
        for (name, value) in [("centre_x_m", centre_x_m), ("centre_y_m", centre_y_m)] {
            if !(-Self::CENTRE_M_MAX..=Self::CENTRE_M_MAX).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed: "between -10 and 10 m" });
            }
        }
        Ok(Self { centre_x_m, centre_y_m, ..self })
    }

    /// Window with the grid's number of pixels and other pitches, for methods that determine the pitch.
    pub(crate) fn with_pitches(grid: &Grid, pitch_x_m: f64, pitch_y_m: f64) -> Self {
        Self { pitch_x_m, pitch_y_m, ..Self::of(grid) }
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

    /// Distance between neighbouring columns \[m\].
    #[must_use]
    pub fn pitch_x_m(&self) -> f64 {
        self.pitch_x_m
    }

    /// Distance between neighbouring rows \[m\].
    #[must_use]
    pub fn pitch_y_m(&self) -> f64 {
        self.pitch_y_m
    }

    /// Position of the window's centre along x, from the axis \[m\].
    #[must_use]
    pub fn centre_x_m(&self) -> f64 {
        self.centre_x_m
    }

    /// Position of the window's centre along y, from the axis \[m\].
    #[must_use]
    pub fn centre_y_m(&self) -> f64 {
        self.centre_y_m
    }

    /// Position of column `x` from the axis \[m\].
    #[must_use]
    pub fn x_m(&self, x: usize) -> f64 {
        self.centre_x_m + from_middle(x, self.width_px) * self.pitch_x_m
    }

    /// Position of row `y` from the axis \[m\].
    #[must_use]
    pub fn y_m(&self, y: usize) -> f64 {
        self.centre_y_m + from_middle(y, self.height_px) * self.pitch_y_m
    }

    /// Whether the window has the number and pitch of the display's pixels, at any centre.
    #[must_use]
    pub fn has_pixels_of(&self, grid: &Grid) -> bool {
        *self == Self { centre_x_m: self.centre_x_m, centre_y_m: self.centre_y_m, ..Self::of(grid) }
    }
}

/// Number of steps from the middle of `count` samples to sample `i`.
pub(crate) fn from_middle(i: usize, count: usize) -> f64 {
    i as f64 - (count as f64 - 1.0) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_window_lies_opposite_display_pixels() {
        let grid = Grid::try_new(3, 4, 8e-6).unwrap();
        let window = ImageWindow::of(&grid);
        assert_eq!([0, 1, 2].map(|y| window.y_m(y)), [-8e-6, 0.0, 8e-6]);
        assert_eq!([0, 3].map(|x| window.x_m(x)), [-12e-6, 12e-6]);
        let beside = window.centred_at(1e-3, 0.0).unwrap();
        assert!(beside.has_pixels_of(&grid) && beside != window);
        assert!((beside.x_m(0) - 0.988e-3).abs() < 1e-15);
    }

    #[test]
    fn invalid_windows_are_refused() {
        let window = ImageWindow::try_new(8, 8, 8e-6).unwrap();
        for bad in [f64::NAN, 11.0, f64::NEG_INFINITY] {
            assert!(window.centred_at(bad, 0.0).unwrap_err().to_string().starts_with("centre_x_m is"));
            assert!(window.centred_at(0.0, bad).unwrap_err().to_string().starts_with("centre_y_m is"));
        }
        assert!(ImageWindow::try_new(0, 8, 8e-6).is_err());
    }
}
