//! Image quality metrics: the agreement of a reconstruction with its target, and the part of the light that arrives.
//!
//! | metric | measures | source |
//! |---|---|---|
//! | [`psnr_db`], [`mse`] | the error of the light, pixel by pixel | |
//! | [`ssim()`] | the agreement of local brightness, contrast and structure, 1 at best | Wang et al. 2004 |
//! | [`ms_ssim()`] | the agreement of contrast and structure over five scales, 1 at best | Wang et al. 2003 |
//! | [`diffraction_efficiency()`], [`frame_efficiency`] | the part of the light that arrives where it is wanted | |
//! | [`speckle_contrast()`] | the graininess of evenly lit areas, 0 at best | Goodman 2007 |
//!
//! Reconstructions and targets are linear light with peak 1 and are compared in a region of interest. Light is not
//! clipped: light above the peak counts as an error. A reconstruction has the size of its target, or a whole multiple
//! of it when each pixel has several sub-samples along a side ([`Engine::samples`](crate::Engine::samples)). Each
//! sub-sample is compared with the target of its pixel. The region is given in the target's pixels and holds all
//! sub-samples of its pixels.
//!
//! Sums are computed in f64 and in the order of the rows, so results do not depend on the number of threads.
//! [`quality`](crate::hologram::quality) computes all metrics of a hologram, as each detector measures it.

mod diffraction_efficiency;
mod ms_ssim;
mod pair;
mod psnr;
mod speckle_contrast;
mod ssim;

pub use diffraction_efficiency::{diffraction_efficiency, frame_efficiency};
pub use ms_ssim::{MS_SSIM_SIDE_MIN, ms_ssim};
pub use pair::Gain;
pub use psnr::{fitted_intensity_scale, mse, psnr_db, psnr_with_offset_db};
pub use speckle_contrast::{FLAT_PIXELS_MIN, speckle_contrast};
pub use ssim::{SSIM_SIDE_MIN, ssim};

pub(crate) use ms_ssim::ssim_at_all_scales;
pub(crate) use pair::ImagePair;

/// Test images that a few lines of any language can reproduce, with values that are exact in f32.
#[cfg(test)]
mod test_images {
    use crate::numerics::Plane;

    /// The mean of four triangle waves with periods of 64, 128, 256 and 32 px.
    pub(super) fn card(height_px: usize, width_px: usize) -> Plane<f32> {
        let triangle = |v: usize, half: usize| ((v % (2 * half)) as f32 - half as f32).abs() / half as f32;
        Plane::from_fn(height_px, width_px, |y, x| {
            (triangle(y, 32) + triangle(x, 64) + triangle(x + y, 128) + triangle(3 * x + 4096 - y, 16)) / 4.0
        })
    }

    /// [`card`] with noise of up to 1/8 added.
    pub(super) fn noisy_card(height_px: usize, width_px: usize) -> Plane<f32> {
        let card = card(height_px, width_px);
        Plane::from_fn(height_px, width_px, |y, x| {
            (card.at(y, x) + (((y * y + 3 * x * y + 5 * x) % 17) as f32 - 8.0) / 64.0).abs()
        })
    }
}
