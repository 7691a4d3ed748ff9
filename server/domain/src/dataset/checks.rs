//! What is noticed about pairs.

use serde::{Deserialize, Serialize};

/// What was measured of a pair when it was added, or when the dataset's alignment changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairChecks {
    /// Part of the photograph's pixels that are saturated, in the region of interest.
    pub saturated: f64,
    /// Part of them that are black: at or below the camera's black level.
    pub black: f64,
    /// All but a thousandth of the photograph is darker than this, full scale 1.
    pub brightest: f64,
    /// Standard deviation of the light over its mean.
    pub contrast: f64,
    /// Correlation of the photograph with the hologram's simulated reconstruction, both coarse; `None` where one of them is
    /// even.
    pub correlation: Option<f64>,
    /// Loss of light from the middle to the corners against the reconstruction; `None` where that cannot be told.
    pub vignetting: Option<f64>,
    /// Root mean square displacement of the photograph from the reconstruction \[px of the display\]; `None` where too little
    /// is recognized.
    pub misalignment_px: Option<f64>,
    /// The part of it that no shift undoes: turn, scale and shear \[px of the display\].
    pub distortion_px: Option<f64>,
    /// Columns and rows of the photograph \[px\].
    pub photo_px: [u32; 2],
    /// Digests of the decoded values: other files with the same pixels are the same picture.
    pub phase_values: String,
    /// See there.
    pub photo_values: String,
    /// What the photograph and the reconstruction look like from afar, as hexadecimal digits.
    pub seen: String,
    /// See there.
    pub expected: String,
    /// The alignment that this was measured with; `None`: one camera pixel a pixel of the display.
    pub homography: Option<[f64; 9]>,
}

/// Something that somebody should know about a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// The pair; empty: the whole dataset.
    pub pair: String,
    /// What kind of thing.
    pub kind: FindingKind,
    /// The pair is not learned from because of it.
    pub excludes: bool,
    /// For people: what, how much, and what to do.
    pub message: String,
}

/// Kinds of findings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingKind {
    /// No light.
    Black,
    /// Too much light.
    Saturated,
    /// Much of it is cut off at black.
    BlackClipped,
    /// Hardly any structure.
    LowContrast,
    /// The same picture as another pair's.
    Duplicate,
    /// The photograph shows something else than the hologram.
    WrongHologram,
    /// The photograph is displaced or turned.
    Misaligned,
    /// Light falls off towards the corners.
    Vignetting,
    /// Some pairs say how they were exposed, and others don't.
    ExposureUnknown,
}
