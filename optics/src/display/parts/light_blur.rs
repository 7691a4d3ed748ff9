//! Blur of the light: how the light that reaches the pixels of the camera becomes what a photograph shows.
//!
//! ```text
//! b(y, x) = Σ_k Σ_l K_k(q_y) K_l(q_x) p(y + k, x + l),   K_k(q) = q^{k²} / Σ_j q^{j²},   j, k, l = −6 … 6
//! ```
//!
//! p is the light of a pixel, or of one place in each pixel if the [detector](crate::Detector) keeps several: each
//! place blurs with the same place of its neighbours. K samples a Gaussian of standard deviation σ = 1/√(−2 ln q)
//! \[px\]. Light outside the frame is not known, so beyond its edge the light of the edge continues.
//!
//! The lens of a camera blurs the light, and so does a source with an extent: each of its directions moves the image by
//! direction times distance, and the images do not interfere. Photographs of one distance cannot tell the two apart.

use super::blur_ratios::BlurRatios;
use super::blur_row::BlurRow;
use super::measures::Measures;
use super::terms::{Terms, Turn};
use super::{Block, blur_row};
use crate::error::Result;
use crate::numerics::Plane;
use crate::numerics::gaussian_blur::{GaussianBlur, by_definition};

/// Least relative decrease of the validation loss by which learning keeps a blur. The sub-samples of a pixel stand for
/// its integral to 2 % of the light's variation, and a small blur mends some of that: on a display without a flaw it
/// lowers the loss by a fifth.
const GAIN_MIN: f64 = 0.3;
/// Number of weights along an axis: six pixels on either side blur into a pixel.
pub(crate) const TAPS: usize = 13;

/// Blur of the light, along x and along y.
pub type LightBlur = BlurRatios<TAPS>;

impl LightBlur {
    /// Largest q, of a standard deviation of 1.98 px: six pixels on either side are three standard deviations.
    pub const RATIO_MAX: f64 = blur_row::RATIO_MAX;

    pub(crate) fn validate(&self) -> Result<()> {
        self.validate_within("light blur", Self::RATIO_MAX, "0 to 0.88")
    }
}

/// A blur of light in the precision of an engine.
pub(crate) type Blur<T> = GaussianBlur<T, TAPS>;

/// Blurred light by the definition: slow, for comparison.
#[must_use]
pub fn blurred_light(light: &Plane<f64>, blur: &LightBlur) -> Plane<f64> {
    by_definition::<TAPS>(light, blur.ratios())
}

pub(super) const ROW: BlurRow<TAPS> = BlurRow {
    block: Block::LightBlur,
    name: "light_blur",
    title: "blur of the light, by the camera or an extended source",
    entry: "has_light_blur",
    ratio_max: LightBlur::RATIO_MAX,
    of: |model| model.light_blur,
    of_mut: |model| &mut model.light_blur,
    terms: Terms::new(Turn::First, GAIN_MIN, GAIN_MIN),
    measures: &Measures { note: "Photographs at one distance cannot tell the two apart.", ..blur_row::MEASURES },
    hidden: None,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_keeps_light_and_widens_a_point_by_its_variance() {
        let blur = LightBlur::of_sigma_px([0.9, 0.5]);
        let point = Plane::from_fn(31, 35, |y, x| f64::from(u8::from((y, x) == (15, 17))));
        let blurred = blurred_light(&point, &blur);
        let moment = |of: fn(f64, f64) -> f64| -> f64 {
            let places = (0..31).flat_map(|y| (0..35).map(move |x| (y, x)));
            places.map(|(y, x)| of(y as f64 - 15.0, x as f64 - 17.0) * blurred.at(y, x)).sum()
        };
        assert!((moment(|_, _| 1.0) - 1.0).abs() < 1e-12);
        // A Gaussian of 0.5 px that is sampled at the pixels has 2 % less variance.
        assert!((moment(|_, x| x * x) / 0.81 - 1.0).abs() < 1e-3, "{}", moment(|_, x| x * x));
        assert!((moment(|y, _| y * y) / 0.25 - 1.0).abs() < 0.15, "{}", moment(|y, _| y * y));
        let flat = Plane::filled(9, 7, 0.3);
        assert!(blurred_light(&flat, &blur).values().iter().all(|light| (light - 0.3).abs() < 1e-15));
    }

    #[test]
    fn ratio_has_limits() {
        assert!((LightBlur::of_sigma_px([1.9, 0.5]).sigma_px()[0] - 1.9).abs() < 1e-12);
        assert!(LightBlur::of_sigma_px([1.97, 0.0]).validate().is_ok());
        assert!(LightBlur::of_sigma_px([2.0, 0.0]).validate().is_err());
        assert!(LightBlur { ratio_x: 0.1, ratio_y: -0.1 }.validate().is_err());
        assert!(LightBlur { ratio_x: f64::NAN, ratio_y: 0.1 }.validate().is_err());
    }
}
