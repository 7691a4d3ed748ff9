//! The angular spectrum onto a window of any pitch, size and position.
//!
//! ```text
//! frequencies whose light lands within K of the window's middle x₀:  f(x₀ − K) … f(x₀ + K),   f(x) = x / (λ√(x² + z²))
//! δf = 1/(R + K),   R = (S₀ + S₁)/2
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], S₀ and S₁ the sides of display and window \[m\]. Apart from the offset x₀, R
//! is the largest distance between a pixel of the display and a pixel of the window. Light that lands up to R away
//! belongs into the window and is kept whole. From R to K it fades out as cos², because a sharp end of the band would
//! ring in the window. Light that lands more than K away is left out: light 1/δf away would come back on the other
//! side. K is 1.5 times the spread of the pixels' light plus |x₀|, at least R and at most 3R. Both Fourier sums are
//! [chirp-z transforms](super::chirp_z).
//! Sources: T. Shimobaba, K. Matsushima et al., Optics Letters 37, 4128 (2012), for scaled angular spectra; K.
//! Matsushima, Optics Express 18, 18453 (2010), for the one-sided limits.

use super::frequency_window::FrequencyAxis;
use super::shifted::frequency_landing_at;
use crate::display::{ImageWindow, OpticalSetup};

/// The frequencies of the scaled method along x and y.
pub(crate) fn scaled_axes(setup: &OpticalSetup, window: &ImageWindow) -> [FrequencyAxis; 2] {
    let grid = setup.grid();
    let axis = |side_px: usize, window_px: usize, window_pitch_m: f64, centre_m: f64| {
        let (pitch_m, wavelength_m, z) = (grid.pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
        let apart_m = 0.5 * (side_px as f64 * pitch_m + window_px as f64 * window_pitch_m);
        let reach_m = kept_reach_m(apart_m, centre_m.abs(), spread_m(pitch_m, wavelength_m, z));
        let nyquist = 0.5 / pitch_m;
        let ends = [centre_m - reach_m, centre_m + reach_m]
            .map(|x_m| (frequency_landing_at(x_m, wavelength_m, z) * z.signum()).clamp(-nyquist, nyquist));
        let spacing_per_m = 1.0 / (apart_m + reach_m);
        let axis = FrequencyAxis::between(ends[0].min(ends[1]), ends[0].max(ends[1]), spacing_per_m);
        FrequencyAxis { whole_m: apart_m, reach_m, ..axis }
    };
    [
        axis(grid.width_px(), window.width_px(), window.pitch_x_m(), window.centre_x_m()),
        axis(grid.height_px(), window.height_px(), window.pitch_y_m(), window.centre_y_m()),
    ]
}

/// Largest sideways distance \[m\] at which the light of a pixel lands. Infinite for pixels that send light at every
/// angle.
pub(super) fn spread_m(pitch_m: f64, wavelength_m: f64, distance_m: f64) -> f64 {
    let sine = 0.5 * wavelength_m / pitch_m;
    if sine < 1.0 { distance_m.abs() * sine / (1.0 - sine * sine).sqrt() } else { f64::INFINITY }
}

/// The reach K \[m\] for R = `apart_m` and a window whose middle is `centre_m` off the axis.
fn kept_reach_m(apart_m: f64, centre_m: f64, spread_m: f64) -> f64 {
    const REACH_OVER_APART_MAX: f64 = 3.0;
    // More than 1, so that a band that lands inside stays whole up to its corners.
    const REACH_OVER_SPREAD: f64 = 1.5;
    (REACH_OVER_SPREAD * spread_m + centre_m).clamp(apart_m, REACH_OVER_APART_MAX * apart_m)
}
