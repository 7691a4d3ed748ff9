//! Cross-talk between neighbouring pixels of the SLM: how the phases that it is given become the phases that it shows.
//!
//! ```text
//! ψ(y, x) = Σ_k Σ_l K_k(q_y) K_l(q_x) wrap( φ + grating )(y + k, x + l),   K_k(q) = q^{k²} / Σ_j q^{j²},   j, k, l = −3 … 3
//! ```
//!
//! φ is the phase \[rad\], wrapped to [0, 2π) with the carrier's grating before it blurs, as the voltages of
//! neighbouring pixels blur. So a jump from 2π to 0 becomes a slope. q along each axis is the weight of a neighbour
//! relative to the pixel's own. K samples a Gaussian of standard deviation σ = 1/√(−2 ln q) \[px\]. Beyond the edge,
//! the phases of the edge continue. Measured modulators: S. Moser, M. Ritsch-Marte and G. Thalhammer, Optics Express
//! 27, 25046 (2019).

use super::blur_ratios::BlurRatios;
use super::blur_row::BlurRow;
use super::terms::Terms;
use super::{Block, blur_row};
use crate::error::Result;
use crate::numerics::Plane;
use crate::numerics::gaussian_blur::{GaussianBlur, by_definition};

/// Number of weights along an axis: three pixels on either side blur into a pixel.
const TAPS: usize = 7;

/// Cross-talk between neighbouring pixels, as a blur of their phases.
pub type Crosstalk = BlurRatios<TAPS>;

impl Crosstalk {
    /// Largest q, of a standard deviation of 0.99 px. With a larger one, more than three pixels on either side would
    /// count.
    pub const RATIO_MAX: f64 = 0.6;

    pub(crate) fn validate(&self) -> Result<()> {
        self.validate_within("crosstalk", Self::RATIO_MAX, "0 to 0.6")
    }
}

/// The blur of phases by cross-talk.
pub(crate) type Blur<T> = GaussianBlur<T, TAPS>;

/// The phases that an SLM with cross-talk shows for wrapped phases, by the definition: slow, for comparison.
#[must_use]
pub fn shown_phase(wrapped: &Plane<f64>, crosstalk: &Crosstalk) -> Plane<f64> {
    by_definition::<TAPS>(wrapped, crosstalk.ratios())
}

pub(super) const ROW: BlurRow<TAPS> = BlurRow {
    block: Block::Crosstalk,
    name: "crosstalk",
    title: "cross-talk between neighbouring pixels",
    entry: "has_crosstalk",
    ratio_max: Crosstalk::RATIO_MAX,
    of: |model| model.crosstalk,
    of_mut: |model| &mut model.crosstalk,
    terms: Terms::USUAL,
    measures: &blur_row::MEASURES,
    hidden: Some(blur_row::hidden_px),
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratio_has_limits() {
        let crosstalk = Crosstalk::of_sigma_px([0.45, 0.0]);
        assert!((crosstalk.sigma_px()[0] - 0.45).abs() < 1e-12 && crosstalk.sigma_px()[1] == 0.0);
        assert!(Crosstalk { ratio_x: 0.7, ratio_y: 0.0 }.validate().is_err());
        assert!(Crosstalk { ratio_x: 0.1, ratio_y: f64::NAN }.validate().is_err());
    }
}
