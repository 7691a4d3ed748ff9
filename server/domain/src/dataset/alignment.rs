//! Where the camera sees the display's pixels.

use serde::{Deserialize, Serialize};

/// A dataset's alignment: from pixels of the display to pixels of the photographs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// What it was found from.
    pub method: AlignmentMethod,
    /// Row by row: camera = H · display, x right, y down, pixel centres at whole numbers.
    pub homography: [f64; 9],
    /// Rows of the photographs \[px\].
    pub photo_height_px: u32,
    /// Columns of the photographs \[px\].
    pub photo_width_px: u32,
    /// Points, dots or tiles that it rests on.
    pub points: u32,
    /// Root mean square distance of those from it \[px of the display\].
    pub residual_px: f64,
    /// What it corrects: the root mean square displacement from the alignment before, over the region of interest
    /// \[px of the display\]; 0 where there was none to compare with.
    pub corrected_px: f64,
    /// Digest of the photograph that it was found in; empty where there are several or none.
    pub photo: String,
    /// Digests of pictures of a photograph before and after; empty where there are none.
    pub before: String,
    /// See there.
    pub after: String,
}

/// What an alignment was found from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AlignmentMethod {
    /// Given points.
    Points,
    /// The photograph of a displayed grid of dots.
    Dots,
    /// Correlation of the pairs' photographs with their simulated reconstructions.
    Pairs,
}
