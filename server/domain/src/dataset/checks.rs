//! Measurements of pairs, and findings about them.

use super::CameraMap;
use serde::{Deserialize, Serialize};

/// Measurements of a pair, made when it was added or when the alignment of the dataset changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairChecks {
    /// Fraction of the photograph's pixels in the region of interest that are saturated.
    pub saturated: f64,
    /// Fraction of the photograph's pixels in the region of interest that are black: at or below the camera's black
    /// level.
    pub black: f64,
    /// Value below which all but a thousandth of the photograph lies, with full scale 1.
    pub brightest: f64,
    /// Contrast of the photograph: standard deviation of the light divided by its mean.
    pub contrast: f64,
    /// Correlation of the photograph with the simulated reconstruction of the hologram, both at low resolution; `None`
    /// if one of them is uniform.
    pub correlation: Option<f64>,
    /// Loss of light from the middle to the corners, relative to the reconstruction; `None` if it cannot be measured.
    pub vignetting: Option<f64>,
    /// Root mean square displacement of the photograph from the reconstruction \[px of the display\]; `None` if too few
    /// features are recognized.
    pub misalignment_px: Option<f64>,
    /// Displacement of the middle \[px of the display\].
    pub shift_px: Option<f64>,
    /// Root mean square displacement by a turn about the middle, negative for a turn from y towards x \[px of the
    /// display\]. Only a turned camera makes one.
    pub turn_px: Option<f64>,
    /// Uncertainty of `turn_px` \[px of the display\].
    pub turn_uncertainty_px: Option<f64>,
    /// Root mean square displacement by scale and shear \[px of the display\]: the camera's, or that of the modulator's
    /// uneven surface.
    pub stretch_px: Option<f64>,
    /// The largest value of the photograph's file; `None`: the photograph is empty.
    pub largest: Option<LargestValue>,
    /// Columns and rows of the photograph \[px\].
    pub photo_px: [u32; 2],
    /// Digest of the hologram's decoded values: files with equal pixels have equal digests.
    pub phase_values: String,
    /// Digest of the photograph's decoded values: files with equal pixels have equal digests.
    pub photo_values: String,
    /// The photograph at very low resolution, as hexadecimal digits.
    pub seen: String,
    /// The reconstruction at very low resolution, as hexadecimal digits.
    pub expected: String,
    /// Map with which the pair was measured; `None`: one camera pixel for each pixel of the display.
    #[serde(flatten)]
    pub map: Option<CameraMap>,
}

/// The largest value of a photograph, as its file has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LargestValue {
    /// The value.
    pub value: f64,
    /// Value of the camera's full scale: 255, 65535, 2^bits − 1 of the declared bits, or 1 for arrays of floats.
    pub full_scale: f64,
    /// Fraction of the pixels that have exactly this value in one of their colours.
    pub share: f64,
    /// Fraction of the pixels whose brightest colour is lower by up to a hundredth, and of whole numbers by up to three.
    pub share_below: f64,
}

/// A problem of a dataset or pair that the user should know about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Id of the pair; empty: the whole dataset.
    pub pair: String,
    /// Kind of the finding.
    pub kind: FindingKind,
    /// Whether the pair is excluded from learning because of the finding.
    pub excludes: bool,
    /// Text for people: the problem, its size, and what to do.
    pub message: String,
}

/// Kinds of findings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingKind {
    /// The photograph shows no light.
    Black,
    /// Too much of the photograph is saturated.
    Saturated,
    /// Many pixels have the largest value, which is below full scale.
    Clipped,
    /// The photographs have no value above that of fewer bits than their files have.
    FewerBits,
    /// Much of the photograph is clipped at black.
    BlackClipped,
    /// The photograph has hardly any structure.
    LowContrast,
    /// Another pair has the same picture.
    Duplicate,
    /// The photograph shows something other than the hologram.
    WrongHologram,
    /// The photographs are turned, or displaced by more than learning can be expected to find.
    Misaligned,
    /// The photographs are displaced by scale and shear, which may be the camera's or the display's.
    Stretched,
    /// The light falls off towards the corners.
    Vignetting,
    /// The exposure of some pairs is known, and that of others is not.
    ExposureUnknown,
    /// The dataset has few pairs for learning or for validation, or a pair has another use than was asked for, because
    /// too few others can be used.
    FewPairs,
}
