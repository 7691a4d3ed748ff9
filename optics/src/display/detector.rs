//! Detectors: rules that define the light of a pixel.
//!
//! The intensity of a field has twice the bandwidth of the field. If the field is sampled at the pixel pitch, its
//! values at the sample points therefore say little about the light between them. A detector uses *sub-samples*: values
//! of the same band-limited field, shifted by fractions of a pixel through a linear phase on its spectrum.

use serde::{Deserialize, Serialize};

/// Rule that defines the light of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Detector {
    /// \|u\|² at the sample point only.
    Point,
    /// Light integrated over the pixel, as a camera of the same pitch sees it: the mean of \|u\|² over the four
    /// sub-samples at (±0.271, ±0.271) px. These places give the integral to 2 % of the light's variation within the
    /// pixels; ±1/4 px would give it to 6 %.
    #[default]
    Pixel,
    /// \|u\|² at each of the four sub-samples at (±1/4, ±1/4) px separately, which constrains the light within each
    /// pixel, as an eye sees it. Two samples per pixel along each axis are all that the intensity of one order holds.
    Supersampled,
}

impl Detector {
    /// All detectors.
    pub const ALL: [Self; 3] = [Self::Point, Self::Pixel, Self::Supersampled];

    /// Offsets of the sub-samples from the pixel's centre along one axis \[px\]. Both axes have the same offsets.
    #[must_use]
    pub fn offsets_px(self) -> &'static [f64] {
        match self {
            Self::Point => &[0.0],
            Self::Pixel => &[-0.271, 0.271],
            Self::Supersampled => &[-0.25, 0.25],
        }
    }

    /// Places of the sub-samples (x, y) from the pixel's centre \[px\], ordered by y, then by x.
    pub(crate) fn places_px(self) -> Vec<[f64; 2]> {
        let offsets_px = self.offsets_px();
        offsets_px.iter().flat_map(|&y| offsets_px.iter().map(move |&x| [x, y])).collect()
    }

    /// Number of sub-samples per pixel.
    #[must_use]
    pub fn samples(self) -> usize {
        self.offsets_px().len().pow(2)
    }
}
