//! A blur along both axes, by the weight of a neighbour: what cross-talk and the blur of the light are.

use crate::error::Result;
use crate::numerics::gaussian_blur::{ratio_of_sigma_px, sigma_px_of_ratio};
use crate::numerics::smooth_field::out_of_range;

/// A blur with `TAPS` weights along each axis: the weight q of a neighbour relative to the pixel's own, along x and
/// along y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlurRatios<const TAPS: usize> {
    /// q along x, from 0 to the `RATIO_MAX` of the blur.
    pub ratio_x: f64,
    /// q along y, from 0 to the `RATIO_MAX` of the blur.
    pub ratio_y: f64,
}

impl<const TAPS: usize> BlurRatios<TAPS> {
    /// Number of weights along an axis, which is odd.
    pub const TAPS: usize = TAPS;
    /// No blur.
    pub const NONE: Self = Self { ratio_x: 0.0, ratio_y: 0.0 };

    /// Blur with a standard deviation along x and one along y \[px\].
    #[must_use]
    pub fn of_sigma_px(sigma_px: [f64; 2]) -> Self {
        Self::of_ratios(sigma_px.map(ratio_of_sigma_px))
    }

    /// Blur with q along x and along y.
    #[must_use]
    pub fn of_ratios([ratio_x, ratio_y]: [f64; 2]) -> Self {
        Self { ratio_x, ratio_y }
    }

    /// Standard deviation along x and along y \[px\].
    #[must_use]
    pub fn sigma_px(&self) -> [f64; 2] {
        self.ratios().map(sigma_px_of_ratio)
    }

    /// Whether nothing blurs.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// q along x and along y.
    #[must_use]
    pub fn ratios(&self) -> [f64; 2] {
        [self.ratio_x, self.ratio_y]
    }

    /// Checks that both q are from 0 to `ratio_max`, which `allowed` says in words.
    pub(super) fn validate_within(&self, name: &'static str, ratio_max: f64, allowed: &'static str) -> Result<()> {
        match self.ratios().into_iter().find(|q| !(0.0..=ratio_max).contains(q)) {
            Some(q) => Err(out_of_range(name, q, allowed)),
            None => Ok(()),
        }
    }
}
