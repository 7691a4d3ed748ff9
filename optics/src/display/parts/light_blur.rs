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
use super::layout::Layout;
use super::measures::{Deviation, Measures};
use super::stored::{Entry, Restored, Stored, StoredParts};
use super::terms::{Terms, Turn};
use super::{Block, Part, sigma};
use crate::display::DisplayModel;
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
    pub const RATIO_MAX: f64 = sigma::RATIO_MAX;

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

/// Its numbers are q along x and along y.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "light_blur"
    }

    fn title(&self) -> &'static str {
        "blur of the light, by the camera or an extended source"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.light_blur.is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.light_blur = LightBlur::NONE;
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        if !model.light_blur.is_none() {
            to.sometimes("has_light_blur", Entry::Flag(true));
            to.list("light_blur", &model.light_blur.ratios());
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        if from.flag("has_light_blur")? {
            model.light_blur = LightBlur::of_ratios(from.exactly("light_blur", "two f64")?);
        }
        Ok(())
    }

    fn count(&self, layout: &Layout) -> usize {
        if layout.blocks.contains(Block::LightBlur) { 2 } else { 0 }
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        model.light_blur.ratios().into_iter().take(self.count(layout)).collect()
    }

    fn set(&self, _layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        model.light_blur = numbers.first_chunk().map_or(LightBlur::NONE, |&ratios| LightBlur::of_ratios(ratios));
    }

    fn limited(&self, _layout: &Layout, _position: usize, value: f64) -> f64 {
        value.clamp(0.0, LightBlur::RATIO_MAX)
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::new(Turn::First, GAIN_MIN, GAIN_MIN))
    }

    fn measures(&self) -> &'static Measures {
        &Measures { note: "Photographs at one distance cannot tell the two apart.", ..sigma::MEASURES }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        model.light_blur.sigma_px().to_vec()
    }

    fn deviations(&self, _layout: &Layout, model: &DisplayModel, deviation: Deviation<'_>) -> Option<Vec<f64>> {
        Some(sigma::deviations_px(model.light_blur.ratios(), deviation))
    }
}

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
