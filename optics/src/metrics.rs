//! How close a reconstruction comes to its target.
//!
//! ```text
//! MSE = Σ (s p − t)² / n,   PSNR = −10 log₁₀ MSE,   s = Σ t p / Σ p²  where the gain is fitted
//! ```
//!
//! p reconstruction, t target, both linear light with peak 1; sums over the n pixels of a region of interest, in f64
//! and in a fixed order. s is the gain with the smallest MSE: how bright a display shines is a matter of exposure.

use crate::{Error, Plane, RegionOfInterest, Result};

/// What the reconstruction is multiplied by before it is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gain {
    /// The gain with the smallest error.
    Fitted,
    /// This gain.
    Given(f64),
}

/// Peak signal to noise ratio \[dB\] over the region of interest, for a peak of 1.
///
/// Infinite where the two are equal after the gain; that includes a fitted gain of 0 against a black target. A black
/// reconstruction gives −10 log₁₀ of the target's mean square. Values that are not finite give NaN.
///
/// # Errors
///
/// [`Error::SizeMismatch`] when the two differ in size; [`Error::OutOfRange`] when the region leaves them.
pub fn psnr_db(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest, gain: Gain) -> Result<f64> {
    Ok(-10.0 * mse(reconstruction, target, roi, gain)?.log10())
}

/// Mean squared error over the region of interest, after the gain.
///
/// # Errors
///
/// As [`psnr_db`].
pub fn mse(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest, gain: Gain) -> Result<f64> {
    let scale = match gain {
        Gain::Fitted => fitted_intensity_scale(reconstruction, target, roi)?,
        Gain::Given(scale) => scale,
    };
    let sum = sum_over_pairs(reconstruction, target, roi, |p, t| (scale * p - t).powi(2))?;
    Ok(sum / roi.pixels() as f64)
}

/// The gain s that brings s · reconstruction closest to the target; 0 for a black reconstruction.
///
/// # Errors
///
/// As [`psnr_db`].
pub fn fitted_intensity_scale(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest) -> Result<f64> {
    let overlap = sum_over_pairs(reconstruction, target, roi, |p, t| p * t)?;
    let energy = sum_over_pairs(reconstruction, target, roi, |p, _| p * p)?;
    Ok(if energy == 0.0 { 0.0 } else { overlap / energy })
}

fn sum_over_pairs(
    reconstruction: &Plane<f32>,
    target: &Plane<f32>,
    roi: RegionOfInterest,
    term: impl Fn(f64, f64) -> f64,
) -> Result<f64> {
    reconstruction.expect_size("reconstruction", target.height_px(), target.width_px())?;
    let (bottom_px, right_px) = (roi.y_px() + roi.height_px(), roi.x_px() + roi.width_px());
    for (name, end, side) in [
        ("region_of_interest's bottom", bottom_px, target.height_px()),
        ("region_of_interest's right side", right_px, target.width_px()),
    ] {
        if end > side {
            return Err(Error::OutOfRange { name, value: end as f64, allowed: "inside the image" });
        }
    }
    let rows = (roi.y_px()..bottom_px).map(|y| {
        let (p, t) = (&reconstruction.row(y)[roi.x_px()..right_px], &target.row(y)[roi.x_px()..right_px]);
        p.iter().zip(t).map(|(&p, &t)| term(f64::from(p), f64::from(t))).sum::<f64>()
    });
    Ok(rows.sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;

    fn ramp() -> Plane<f32> {
        Plane::from_fn(10, 20, |y, x| (y * 20 + x) as f32 / 200.0)
    }

    fn middle() -> RegionOfInterest {
        RegionOfInterest::middle(&Grid::try_new(10, 20, 8e-6).unwrap())
    }

    #[test]
    fn equal_images_are_infinitely_close() {
        assert_eq!(psnr_db(&ramp(), &ramp(), middle(), Gain::Given(1.0)).unwrap(), f64::INFINITY);
        assert_eq!(psnr_db(&ramp(), &ramp(), middle(), Gain::Fitted).unwrap(), f64::INFINITY);
    }

    #[test]
    fn a_constant_error_has_the_textbook_psnr() {
        let off = ramp().map(|value| value + 0.1);
        assert!((psnr_db(&off, &ramp(), middle(), Gain::Given(1.0)).unwrap() - 20.0).abs() < 1e-5);
    }

    #[test]
    fn brightness_does_not_count_where_the_gain_is_fitted() {
        let (bright, target) = (ramp().map(|value| value * 4.0), ramp());
        assert_eq!(fitted_intensity_scale(&bright, &target, middle()).unwrap(), 0.25);
        assert_eq!(psnr_db(&bright, &target, middle(), Gain::Fitted).unwrap(), f64::INFINITY);
        let noisy = Plane::from_fn(10, 20, |y, x| ramp().at(y, x) + if (x + y) % 2 == 0 { 0.05 } else { -0.05 });
        let best = mse(&noisy, &target, middle(), Gain::Fitted).unwrap();
        let scale = fitted_intensity_scale(&noisy, &target, middle()).unwrap();
        for step in [-1e-3, 1e-3] {
            assert!(mse(&noisy, &target, middle(), Gain::Given(scale + step)).unwrap() > best);
        }
    }

    #[test]
    fn black_images_have_a_documented_answer() {
        let black = Plane::filled(10, 20, 0.0);
        assert_eq!(fitted_intensity_scale(&black, &ramp(), middle()).unwrap(), 0.0);
        assert!(psnr_db(&black, &ramp(), middle(), Gain::Fitted).unwrap().is_finite());
        assert_eq!(psnr_db(&ramp(), &black, middle(), Gain::Fitted).unwrap(), f64::INFINITY);
    }

    #[test]
    fn only_the_region_counts() {
        let mut spoiled = ramp();
        spoiled.values_mut()[0] = 1e6;
        assert_eq!(mse(&spoiled, &ramp(), middle(), Gain::Given(1.0)).unwrap(), 0.0);
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        let small = Plane::filled(10, 19, 0.0);
        assert!(matches!(mse(&small, &ramp(), middle(), Gain::Fitted), Err(Error::SizeMismatch { .. })));
        let wide = RegionOfInterest::full(&Grid::try_new(10, 21, 8e-6).unwrap());
        assert!(matches!(mse(&ramp(), &ramp(), wide, Gain::Fitted), Err(Error::OutOfRange { .. })));
    }
}
