//! Alignment of photographs: the map from the display's pixels to the camera's, and resampling on the display's grid.
//!
//! A [`Homography`] maps a point of the image plane, in pixels of the display, to the camera's pixels. It is fitted to
//! given points, to the photograph of a displayed [`DotGrid`], or to pairs of simulated and photographed images
//! ([`registration`]). A [`CameraMap`] has the lens's distortion, too. [`CameraMap::from_points`] fits it to many points,
//! such as dots, and [`find_target`] finds a picture anywhere in a photograph by it. [`warp`](fn@warp) resamples
//! photographs with either map. In all coordinates x points right, y points down, and pixel centres lie at whole numbers.

mod box_blur;
mod camera_fit;
mod camera_map;
mod camera_turn;
mod dot_cells;
mod dot_grid;
mod dot_match;
mod dot_pattern;
mod dot_sighting;
mod error;
mod homography;
mod lattice;
pub mod registration;
mod spots;
mod target_search;
mod warp;

pub use camera_fit::CameraFit;
pub use camera_map::CameraMap;
pub use dot_grid::{DotGrid, DotGridMatch};
pub use dot_sighting::DotSighting;
pub use error::{AlignmentError, CORRELATION_MIN, TARGET_SIDE_MIN};
pub use homography::{Homography, Point, PointFit, PointPair};
pub use registration::Registration;
pub use target_search::{BlockDisplacement, FoundTarget, block_displacements, find_target};
pub use warp::{MapToCamera, warp};
