//! How close a reconstruction comes to its target, and how much of the light arrives.
//!
//! | metric | says | source |
//! |---|---|---|
//! | [`psnr_db`], [`mse`] | how far the light is off, pixel by pixel | |
//! | [`ssim()`] | how well local brightness, contrast and structure agree, 1 at best | Wang et al. 2004 |
//! | [`ms_ssim()`] | the same from fine to coarse, for an eye farther away | Wang et al. 2003 |
//! | [`diffraction_efficiency()`], [`frame_efficiency`] | which part of the light arrives where it is wanted | |
//! | [`speckle_contrast()`] | how grainy evenly lit areas are, 0 at best | Goodman 2007 |
//!
//! Reconstructions and targets are linear light with peak 1, and are compared in a region of interest. Nothing is clipped:
//! light beyond the peak counts as the error that it is. A reconstruction has the size of its target, or a whole multiple
//! of it where every pixel has several sub-samples a side ([`Engine::samples`](crate::Engine::samples)); each of them is
//! compared with its pixel's target, and the region, in the target's pixels, holds all of its pixels' sub-samples.
//!
//! Sums are in f64 and in the order of the rows, so that they are the same on any number of threads.
//! [`quality`](crate::hologram::quality) gives all of them for a hologram, as each detector sees it.

mod diffraction_efficiency;
mod ms_ssim;
mod pair;
mod psnr;
mod speckle_contrast;
mod ssim;

pub use diffraction_efficiency::{diffraction_efficiency, frame_efficiency};
pub use ms_ssim::{MS_SSIM_SIDE_MIN, ms_ssim};
pub use psnr::{Gain, fitted_intensity_scale, mse, psnr_db};
pub use speckle_contrast::{FLAT_PIXELS_MIN, speckle_contrast};
pub use ssim::{SSIM_SIDE_MIN, ssim};

pub(crate) use ms_ssim::ssim_at_all_scales;
pub(crate) use pair::ImagePair;

/// Pictures that a few lines of any language can make again, every value exact in f32.
#[cfg(test)]
mod test_images {
    use crate::Plane;

    /// The mean of four triangle waves, of 64, 128, 256 and 32 px.
    pub(super) fn card(height_px: usize, width_px: usize) -> Plane<f32> {
        let triangle = |v: usize, half: usize| ((v % (2 * half)) as f32 - half as f32).abs() / half as f32;
        Plane::from_fn(height_px, width_px, |y, x| {
            (triangle(y, 32) + triangle(x, 64) + triangle(x + y, 128) + triangle(3 * x + 4096 - y, 16)) / 4.0
        })
    }

    /// [`card`] and a noise of up to 1/8.
    pub(super) fn spoiled(height_px: usize, width_px: usize) -> Plane<f32> {
        let card = card(height_px, width_px);
        Plane::from_fn(height_px, width_px, |y, x| {
            (card.at(y, x) + (((y * y + 3 * x * y + 5 * x) % 17) as f32 - 8.0) / 64.0).abs()
        })
    }
}
