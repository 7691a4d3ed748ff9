//! The part of an image that counts.

use crate::{Error, Grid, Result};
use serde::{Deserialize, Serialize};

/// A rectangle of pixels in the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    x_px: usize,
    y_px: usize,
    width_px: usize,
    height_px: usize,
}

impl RegionOfInterest {
    /// # Errors
    ///
    /// [`Error::OutOfRange`] when the rectangle is empty or leaves the grid.
    pub fn try_new(grid: &Grid, x_px: usize, y_px: usize, width_px: usize, height_px: usize) -> Result<Self> {
        for (name, start, length, side) in [
            ("region_of_interest.width_px", x_px, width_px, grid.width_px()),
            ("region_of_interest.height_px", y_px, height_px, grid.height_px()),
        ] {
            if length == 0 || start.checked_add(length).is_none_or(|end| end > side) {
                let allowed = "at least 1 and end inside the image";
                return Err(Error::OutOfRange { name, value: length as f64, allowed });
            }
        }
        Ok(Self { x_px, y_px, width_px, height_px })
    }

    /// The same region, where it lies inside a grid: to check one that comes from elsewhere, such as a file.
    ///
    /// # Errors
    ///
    /// As [`Self::try_new`].
    pub fn inside(self, grid: &Grid) -> Result<Self> {
        Self::try_new(grid, self.x_px, self.y_px, self.width_px, self.height_px)
    }

    /// The middle 80 % of each axis, from 10 % to 90 %, at least one pixel.
    #[must_use]
    pub fn middle(grid: &Grid) -> Self {
        let span = |side: usize| {
            let start = (side as f64 * 0.1).round() as usize;
            (start, side.saturating_sub(2 * start).max(1))
        };
        let ((x_px, width_px), (y_px, height_px)) = (span(grid.width_px()), span(grid.height_px()));
        Self { x_px, y_px, width_px, height_px }
    }

    /// All of the image.
    #[must_use]
    pub fn full(grid: &Grid) -> Self {
        Self { x_px: 0, y_px: 0, width_px: grid.width_px(), height_px: grid.height_px() }
    }

    /// First column \[px\].
    #[must_use]
    pub fn x_px(&self) -> usize {
        self.x_px
    }

    /// First row \[px\].
    #[must_use]
    pub fn y_px(&self) -> usize {
        self.y_px
    }

    /// Columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Number of pixels in the region.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width_px * self.height_px
    }

    /// The region's columns in row `y`, or `None` where the row lies outside.
    #[must_use]
    pub fn columns(&self, y: usize) -> Option<std::ops::Range<usize>> {
        (self.y_px..self.y_px + self.height_px).contains(&y).then(|| self.x_px..self.x_px + self.width_px)
    }
}
