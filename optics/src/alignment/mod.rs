//! Alignment of photographs: the map from the display's pixels to the camera's, and resampling on the display's grid.
//!
//! A [`Homography`] maps a point of the image plane, in pixels of the display, to the camera's pixels. It is fitted to
//! given points, to the photograph of a displayed [`DotGrid`], or to pairs of simulated and photographed images
//! ([`registration`]). A [`CameraMap`] has the lens's distortion, too. [`CameraMap::from_points`] fits it to many points,
//! such as dots, and [`find_target`] finds a picture anywhere in a photograph by it. [`warp`](fn@warp) resamples
//! photographs with either map. In all coordinates x points right, y points down, and pixel centres lie at whole numbers.

mod blobs;
mod box_blur;
mod camera_fit;
mod camera_map;
mod camera_turn;
mod dot_grid;
mod homography;
mod lattice;
pub mod registration;
mod target_search;
mod tiles;
mod warp;

pub use camera_fit::CameraFit;
pub use camera_map::CameraMap;
pub use dot_grid::{DotGrid, DotGridMatch};
pub use homography::{Homography, Point, PointFit, PointPair};
pub use registration::Registration;
pub use target_search::{
    BlockDisplacement, CORRELATION_MIN, FoundTarget, TARGET_SIDE_MIN, block_displacements, find_target,
};
pub use tiles::Tiles;
pub use warp::{MapToCamera, warp};

/// Reasons why a photograph cannot be aligned with the display's grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignmentError {
    /// Fewer than the four points that a homography needs.
    #[error("there are {0} points, but a homography needs at least 4")]
    TooFewPoints(usize),
    /// The points do not determine a homography.
    #[error("the points lie on a line, or nearly so; spread them over the image")]
    Degenerate,
    /// A coordinate or an entry is NaN or infinite, or the homography cannot be inverted.
    #[error("{0}")]
    Impossible(String),
    /// The display is too small for a grid of dots.
    #[error("a display of {width_px}×{height_px} px is too small for a grid of dots: both sides need {min_px} px")]
    DisplayTooSmall {
        /// Columns of the display.
        width_px: usize,
        /// Rows of the display.
        height_px: usize,
        /// Shortest side that is allowed \[px\].
        min_px: usize,
    },
    /// The photograph does not show the grid of dots.
    #[error("{found} dots of the grid were found, but at least {needed} are needed: {hint}")]
    DotsNotFound {
        /// Number of dots that form a grid.
        found: usize,
        /// Least number of dots.
        needed: usize,
        /// Advice on how to take a better photograph.
        hint: &'static str,
    },
    /// The photograph shows dots, but not the three large ones that mark the grid's orientation.
    #[error(
        "{found} dots form a grid, but the three large dots that mark its orientation were not found; take a \
         photograph that is in focus and not saturated"
    )]
    MarkersNotFound {
        /// Number of dots that form a grid.
        found: usize,
    },
    /// A picture in which or for which a search makes no sense.
    #[error(
        "the {name} has {width_px}×{height_px} px, but both sides need at least {TARGET_SIDE_MIN} px to be found or \
         searched; send a larger picture"
    )]
    PictureTooSmall {
        /// `photograph` or `target`.
        name: &'static str,
        /// Columns of the picture.
        width_px: usize,
        /// Rows of the picture.
        height_px: usize,
    },
    /// The photograph does not show the target, or not clearly.
    #[error(
        "the target was not found in the photograph: at the best place their details correlate by {correlation:.3}, but \
         at least {CORRELATION_MIN} is needed; check that the photograph shows this target in focus, turned by at most \
         12°, with the target's longer side at least 0.3 times as long as the photograph's"
    )]
    TargetNotFound {
        /// Correlation of the details at the best place.
        correlation: f64,
    },
}
