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
    /// Mean of \|u\|² over the four sub-samples at (±1/4, ±1/4) px, as a camera of the same pitch integrates the light.
    #[default]
    Pixel,
    /// \|u\|² at each of the four sub-samples separately, which constrains the light within each pixel, as an eye sees
    /// it.
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
            Self::Pixel | Self::Supersampled => &[-0.25, 0.25],
        }
    }

    /// Number of sub-samples per pixel.
    #[must_use]
    pub fn samples(self) -> usize {
        self.offsets_px().len().pow(2)
    }
}
