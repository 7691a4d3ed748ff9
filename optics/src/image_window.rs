//! Where in the image plane the field is wanted.

use crate::{Error, Grid, Result};
use serde::{Deserialize, Serialize};

/// A sampled part of the image plane, its samples as far apart and its middle as far from the axis as one likes.
///
/// Row `y`, column `x` lies at (centre_x_m + (x − (width_px − 1)/2) · pitch_x_m, and likewise along y), where (0, 0) is
/// opposite the middle of the display, between its pixels if their number is even.
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
    /// Farthest that a window's middle may lie from the axis, along x or y \[m\]: the farthest image's distance.
    pub const CENTRE_M_MAX: f64 = 10.0;

    /// A window around the axis with square pixels.
    ///
    /// # Errors
    ///
    /// As [`Grid::try_new`].
    pub fn try_new(height_px: usize, width_px: usize, pixel_pitch_m: f64) -> Result<Self> {
        Ok(Self::of(&Grid::try_new(height_px, width_px, pixel_pitch_m)?))
    }

    /// The display's own pixels, seen in the image plane.
    #[must_use]
    pub fn of(grid: &Grid) -> Self {
        let (pitch_m, height_px, width_px) = (grid.pixel_pitch_m(), grid.height_px(), grid.width_px());
        Self { height_px, width_px, pitch_x_m: pitch_m, pitch_y_m: pitch_m, centre_x_m: 0.0, centre_y_m: 0.0 }
    }

    /// The same window, its middle at (`centre_x_m`, `centre_y_m`).
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a middle farther away than [`Self::CENTRE_M_MAX`].
    pub fn centred_at(self, centre_x_m: f64, centre_y_m: f64) -> Result<Self> {
        for (name, value) in [("centre_x_m", centre_x_m), ("centre_y_m", centre_y_m)] {
            if !(-Self::CENTRE_M_MAX..=Self::CENTRE_M_MAX).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed: "between -10 and 10 m" });
            }
        }
        Ok(Self { centre_x_m, centre_y_m, ..self })
    }

    /// For methods that choose the pitch themselves.
    pub(crate) fn with_pitches(grid: &Grid, pitch_x_m: f64, pitch_y_m: f64) -> Self {
        Self { pitch_x_m, pitch_y_m, ..Self::of(grid) }
    }

    /// Rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Columns \[px\].
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

    /// Its middle along x, from the axis \[m\].
    #[must_use]
    pub fn centre_x_m(&self) -> f64 {
        self.centre_x_m
    }

    /// Its middle along y, from the axis \[m\].
    #[must_use]
    pub fn centre_y_m(&self) -> f64 {
        self.centre_y_m
    }

    /// Where column `x` lies, from the axis \[m\].
    #[must_use]
    pub fn x_m(&self, x: usize) -> f64 {
        self.centre_x_m + from_middle(x, self.width_px) * self.pitch_x_m
    }

    /// Where row `y` lies, from the axis \[m\].
    #[must_use]
    pub fn y_m(&self, y: usize) -> f64 {
        self.centre_y_m + from_middle(y, self.height_px) * self.pitch_y_m
    }

    /// Whether it has the display's pixels: their number and pitch, wherever its middle is.
    #[must_use]
    pub fn has_pixels_of(&self, grid: &Grid) -> bool {
        *self == Self { centre_x_m: self.centre_x_m, centre_y_m: self.centre_y_m, ..Self::of(grid) }
    }
}

/// Steps from the middle of `count` samples to sample `i`.
pub(crate) fn from_middle(i: usize, count: usize) -> f64 {
    i as f64 - (count as f64 - 1.0) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_displays_own_window_lies_opposite_its_pixels() {
        let grid = Grid::try_new(3, 4, 8e-6).unwrap();
        let window = ImageWindow::of(&grid);
        assert_eq!([0, 1, 2].map(|y| window.y_m(y)), [-8e-6, 0.0, 8e-6]);
        assert_eq!([0, 3].map(|x| window.x_m(x)), [-12e-6, 12e-6]);
        let beside = window.centred_at(1e-3, 0.0).unwrap();
        assert!(beside.has_pixels_of(&grid) && beside != window);
        assert!((beside.x_m(0) - 0.988e-3).abs() < 1e-15);
    }

    #[test]
    fn windows_out_of_this_world_are_refused() {
        let window = ImageWindow::try_new(8, 8, 8e-6).unwrap();
        for bad in [f64::NAN, 11.0, f64::NEG_INFINITY] {
            assert!(window.centred_at(bad, 0.0).unwrap_err().to_string().starts_with("centre_x_m is"));
            assert!(window.centred_at(0.0, bad).unwrap_err().to_string().starts_with("centre_y_m is"));
        }
        assert!(ImageWindow::try_new(0, 8, 8e-6).is_err());
    }
}
