//! The alignment of a camera with the pixels of the display.

use serde::{Deserialize, Serialize};

/// Alignment of a dataset: maps pixels of the display to pixels of the photographs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// Method by which the alignment was found.
    pub method: AlignmentMethod,
    /// Map from pixels of the display to pixels of the photographs.
    #[serde(flatten)]
    pub map: CameraMap,
    /// Rows of the photographs \[px\].
    pub photo_height_px: u32,
    /// Columns of the photographs \[px\].
    pub photo_width_px: u32,
    /// Number of points, dots or tiles from which the alignment was computed.
    pub points: u32,
    /// Root mean square distance of the points from the alignment \[px of the display\].
    pub residual_px: f64,
    /// Root mean square displacement of this alignment from the previous one, over the region of interest \[px of the
    /// display\]; 0 if there was no previous one.
    pub corrected_px: f64,
    /// Root mean square displacement by scale and shear that the alignment leaves in the photographs, because it may be
    /// the display's \[px of the display\]; 0 if the alignment takes all of it for the camera's.
    pub left_px: f64,
    /// What the alignment corrects, what it leaves and why, in words; empty for points and dots.
    pub explanation: String,
    /// Digest of the photograph in which the alignment was found; empty if there are several or none.
    pub photo: String,
    /// Digest of a picture of a photograph before the alignment; empty if there is none.
    pub before: String,
    /// Digest of a picture of the same photograph after the alignment; empty if there is none.
    pub after: String,
}

/// The map of a camera: perspective, then the distortion of its lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraMap {
    /// Homography H, row by row: camera = H · display, x right, y down, pixel centres at whole numbers.
    pub homography: [f64; 9],
    /// Distortion k₁, k₂, p₁ and p₂ after D. C. Brown (1971), for a radius of 1 in the photograph's corners.
    #[serde(default, skip_serializing_if = "is_straight")]
    pub distortion: [f64; 4],
}

fn is_straight(distortion: &[f64; 4]) -> bool {
    *distortion == [0.0; 4]
}

/// Method of finding an alignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AlignmentMethod {
    /// From given points.
    Points,
    /// From a photograph of a displayed grid of dots.
    Dots,
    /// From the correlation of the pairs' photographs with their simulated reconstructions.
    Pairs,
}
