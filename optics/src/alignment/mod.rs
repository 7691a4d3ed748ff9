//! Where the camera sees each pixel of the image: from photographs as they were taken to photographs on the display's grid.
//!
//! A [`Homography`] takes a point of the image plane, in pixels of the display, to the camera's pixels. It comes from given
//! points, from the photograph of a displayed [`DotGrid`], or from pairs of simulated and photographed images
//! ([`registration`]), and [`warp`](fn@warp) resamples photographs by it. In all of it x goes right, y down, and pixel centres
//! lie at whole numbers.

mod blobs;
mod box_blur;
mod dot_grid;
mod homography;
mod lattice;
pub mod registration;
mod warp;

pub use dot_grid::{DotGrid, DotGridMatch};
pub use homography::{Homography, Point, PointFit, PointPair};
pub use registration::{Registration, Tiles};
pub use warp::warp;

/// Why a photograph could not be brought to the display's grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignmentError {
    /// Four points are the least that a homography follows from.
    #[error("there are {0} points, but a homography needs at least 4")]
    TooFewPoints(usize),
    /// The points do not fix a homography.
    #[error("the points lie on a line, or nearly so; spread them over the image")]
    Degenerate,
    /// A coordinate or an entry is NaN or infinite, or the homography cannot be inverted.
    #[error("{0}")]
    Impossible(String),
    /// A display too small for a grid of dots.
    #[error("a display of {width_px}×{height_px} px is too small for a grid of dots: both sides need {min_px} px")]
    DisplayTooSmall {
        /// Columns.
        width_px: usize,
        /// Rows.
        height_px: usize,
        /// Least side.
        min_px: usize,
    },
    /// The photograph does not show the grid.
    #[error("{found} dots of the grid were found, but at least {needed} are needed: {hint}")]
    DotsNotFound {
        /// Dots that form a grid.
        found: usize,
        /// Least number.
        needed: usize,
        /// What may help.
        hint: &'static str,
    },
    /// Dots, but not the three large ones that say which is which.
    #[error(
        "{found} dots form a grid, but the three large ones in its middle, which tell which way up it is, were not found; \
         is the photograph sharp and not saturated?"
    )]
    MarkersNotFound {
        /// Dots that form a grid.
        found: usize,
    },
}
