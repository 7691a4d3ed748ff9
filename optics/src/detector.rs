//! What counts as the light of a pixel.
//!
//! A field sampled at the pixel pitch has an intensity of twice its bandwidth, so its values at the sample points
//! say little about the light between them. A detector therefore looks at *sub-samples*: the same band-limited
//! field, shifted by fractions of a pixel through a linear phase on its spectrum.

use serde::{Deserialize, Serialize};

/// What counts as the light of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Detector {
    /// \|u\|² at the sample point alone.
    Point,
    /// The mean of \|u\|² over the four sub-samples at (±1/4, ±1/4) px: what a camera of the same pitch integrates.
    #[default]
    Pixel,
    /// \|u\|² at each of the four sub-samples by itself, nothing left free between them: what an eye sees.
    Supersampled,
}

impl Detector {
    /// Every detector.
    pub const ALL: [Self; 3] = [Self::Point, Self::Pixel, Self::Supersampled];

    /// Offsets of the sub-samples from the pixel's centre along one axis \[px\]; both axes have the same.
    #[must_use]
    pub fn offsets_px(self) -> &'static [f64] {
        match self {
            Self::Point => &[0.0],
            Self::Pixel | Self::Supersampled => &[-0.25, 0.25],
        }
    }

    /// Sub-samples per pixel.
    #[must_use]
    pub fn samples(self) -> usize {
        self.offsets_px().len().pow(2)
    }
}
