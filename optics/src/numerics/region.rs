//! Region of interest: the part of an image that losses and metrics evaluate.

use super::grid::Grid;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Rectangle of pixels in the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    x_px: usize,
    y_px: usize,
    width_px: usize,
    height_px: usize,
}

impl RegionOfInterest {
    /// Region with its first pixel at (`x_px`, `y_px`), `width_px` columns and `height_px` rows.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if the rectangle is empty or leaves the grid.
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

    /// Checks that the region lies inside a grid and returns it. Use it for a region from outside, such as from a file.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::try_new`].
    pub fn inside(self, grid: &Grid) -> Result<Self> {
        Self::try_new(grid, self.x_px, self.y_px, self.width_px, self.height_px)
    }

    /// Region in the middle 80 % of each axis, from 10 % to 90 %, with at least one pixel along each axis.
    #[must_use]
    pub fn middle(grid: &Grid) -> Self {
        let span = |side: usize| {
            let start = (side as f64 * 0.1).round() as usize;
            (start, side.saturating_sub(2 * start).max(1))
        };
        let ((x_px, width_px), (y_px, height_px)) = (span(grid.width_px()), span(grid.height_px()));
        Self { x_px, y_px, width_px, height_px }
    }

    /// Region that covers the whole image.
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

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Number of pixels in the region.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width_px * self.height_px
    }

    /// Columns of the region in row `y`, or `None` if the row lies outside the region.
    #[must_use]
    pub fn columns(&self, y: usize) -> Option<std::ops::Range<usize>> {
        (self.y_px..self.y_px + self.height_px).contains(&y).then(|| self.x_px..self.x_px + self.width_px)
    }
}
