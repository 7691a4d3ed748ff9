//! Peak signal-to-noise ratio.
//!
//! ```text
//! MSE = Σ (s p − t)² / n,   PSNR = −10 log₁₀ MSE,   s = Σ t p / Σ p²  where the gain is fitted
//! ```
//!
//! p is the reconstruction, t the target, both linear light with peak 1; sums run over the n samples of a region of
//! interest. s is the gain with the smallest MSE, because the brightness of a display is a matter of exposure.

use super::pair::{Gain, ImagePair};
use crate::error::Result;
use crate::numerics::{Plane, RegionOfInterest};

/// Peak signal to noise ratio \[dB\] over the region of interest, for a peak of 1.
///
/// It is infinite when the two are equal after the gain. That includes a fitted gain of 0 against a black target. For a
/// black reconstruction it is −10 log₁₀ of the target's mean square. Values that are not finite give NaN.
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) when the reconstruction is not of the target's size or a whole
/// multiple of it; [`Error::OutOfRange`](crate::Error::OutOfRange) when the region leaves the target.
pub fn psnr_db(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest, gain: Gain) -> Result<f64> {
    Ok(-10.0 * mse(reconstruction, target, roi, gain)?.log10())
}

/// Peak signal to noise ratio \[dB\] over the region of interest after the gain and the offset with the smallest mean
/// squared error, for a peak of 1: −10 log₁₀ of the mean of (s p + o − t)². The offset undoes a camera's black level
/// and light of the surroundings.
///
/// # Errors
///
/// The errors of [`psnr_db`].
pub fn psnr_with_offset_db(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest) -> Result<f64> {
    let pair = ImagePair::new(reconstruction, target, roi, Gain::Given(1.0))?;
    let count = roi.pixels() as f64 * (pair.height() / roi.height_px()).pow(2) as f64;
    let (p_mean, t_mean) = (pair.sum(|p, _| p) / count, pair.sum(|_, t| t) / count);
    let variance = pair.sum(|p, _| (p - p_mean).powi(2));
    let gain = if variance == 0.0 { 0.0 } else { pair.sum(|p, t| (p - p_mean) * (t - t_mean)) / variance };
    let mse = pair.sum(|p, t| (gain * (p - p_mean) - (t - t_mean)).powi(2)) / count;
    Ok(-10.0 * mse.log10())
}

/// Mean squared error over the region of interest, after the gain.
///
/// # Errors
///
/// The errors of [`psnr_db`].
pub fn mse(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest, gain: Gain) -> Result<f64> {
    Ok(ImagePair::new(reconstruction, target, roi, gain)?.mse())
}

/// The gain s for which s · reconstruction is closest to the target; 0 for a black reconstruction.
///
/// # Errors
///
/// The errors of [`psnr_db`].
pub fn fitted_intensity_scale(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest) -> Result<f64> {
    Ok(ImagePair::new(reconstruction, target, roi, Gain::Fitted)?.gain())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::numerics::Grid;

    fn ramp() -> Plane<f32> {
        Plane::from_fn(10, 20, |y, x| (y * 20 + x) as f32 / 200.0)
    }

    fn middle() -> RegionOfInterest {
        RegionOfInterest::middle(&Grid::try_new(10, 20, 8e-6).unwrap())
    }

    #[test]
    fn equal_images_have_infinite_psnr() {
        assert_eq!(psnr_db(&ramp(), &ramp(), middle(), Gain::Given(1.0)).unwrap(), f64::INFINITY);
        assert_eq!(psnr_db(&ramp(), &ramp(), middle(), Gain::Fitted).unwrap(), f64::INFINITY);
    }

    #[test]
    fn constant_error_has_expected_psnr() {
        let off = ramp().map(|value| value + 0.1);
        assert!((psnr_db(&off, &ramp(), middle(), Gain::Given(1.0)).unwrap() - 20.0).abs() < 1e-5);
    }

    #[test]
    fn fitted_gain_removes_brightness_difference() {
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
    fn fitted_offset_removes_a_black_level() {
        let noisy = Plane::from_fn(10, 20, |y, x| ramp().at(y, x) + if (x + y) % 2 == 0 { 0.05 } else { -0.05 });
        let photo = noisy.map(|value| 0.5 * value + 0.25);
        let found = psnr_with_offset_db(&photo, &ramp(), middle()).unwrap();
        let noise_alone = -20.0 * 0.05_f64.log10();
        assert!((found - noise_alone).abs() < 0.3, "{found} dB");
        assert!(found > psnr_db(&photo, &ramp(), middle(), Gain::Fitted).unwrap() + 5.0);
        let even = Plane::filled(10, 20, 0.3);
        assert!(psnr_with_offset_db(&even, &ramp(), middle()).unwrap().is_finite());
    }

    #[test]
    fn black_images_give_documented_values() {
        let black = Plane::filled(10, 20, 0.0);
        assert_eq!(fitted_intensity_scale(&black, &ramp(), middle()).unwrap(), 0.0);
        assert!(psnr_db(&black, &ramp(), middle(), Gain::Fitted).unwrap().is_finite());
        assert_eq!(psnr_db(&ramp(), &black, middle(), Gain::Fitted).unwrap(), f64::INFINITY);
    }

    #[test]
    fn pixels_outside_region_are_ignored() {
        let mut changed = ramp();
        changed.values_mut()[0] = 1e6;
        assert_eq!(mse(&changed, &ramp(), middle(), Gain::Given(1.0)).unwrap(), 0.0);
    }

    #[test]
    fn sub_samples_are_compared_with_their_pixels() {
        let samples =
            Plane::from_fn(20, 40, |y, x| ramp().at(y / 2, x / 2) + if (y + x) % 2 == 0 { 0.1 } else { -0.1 });
        assert!((psnr_db(&samples, &ramp(), middle(), Gain::Given(1.0)).unwrap() - 20.0).abs() < 1e-5);
        let each_sample_twice = |plane: &Plane<f32>| Plane::from_fn(20, 40, |y, x| plane.at(y / 2, x / 2));
        let noisy = Plane::from_fn(10, 20, |y, x| ramp().at(y, x) + if (x + y) % 2 == 0 { 0.05 } else { -0.05 });
        let once = psnr_with_offset_db(&noisy, &ramp(), middle()).unwrap();
        let twice = psnr_with_offset_db(&each_sample_twice(&noisy), &ramp(), middle()).unwrap();
        assert!((once - twice).abs() < 1e-6, "{once} dB, {twice} dB");
    }

    #[test]
    fn mismatched_sizes_are_refused() {
        let small = Plane::filled(10, 19, 0.0);
        assert!(matches!(mse(&small, &ramp(), middle(), Gain::Fitted), Err(Error::SizeMismatch { .. })));
        for (height_px, width_px) in [(20, 20), (20, 39), (9, 20), (25, 50)] {
            let other = Plane::filled(height_px, width_px, 0.0);
            let error = mse(&other, &ramp(), middle(), Gain::Fitted).unwrap_err();
            assert!(matches!(error, Error::SizeMismatch { .. }), "{height_px}×{width_px}: {error}");
        }
        let wide = RegionOfInterest::full(&Grid::try_new(10, 21, 8e-6).unwrap());
        assert!(matches!(mse(&ramp(), &ramp(), wide, Gain::Fitted), Err(Error::OutOfRange { .. })));
    }
}
