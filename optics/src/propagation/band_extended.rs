//! The band-extended angular spectrum.
//!
//! ```text
//! |f| ≤ f_ext,   f_ext: z·f_ext / √(1/λ² − f_ext²) = N/(4·f_ext)   (≈ ½ √(N/λz)),   δf = 2·f_ext/N
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], N padded pixels along an axis. The method uses as many frequencies as the
//! padded spectrum has, but spreads them over another band: the widest band in which the phase of the transfer function
//! changes by at most half a cycle from sample to sample. Beyond the critical distance z_c this band is wider than the
//! [band limit](crate::propagation::transfer_function::band_limit) by the factor √(z/z_c). Up to z_c it is the pixels' whole band. A
//! [chirp-z transform](super::chirp_z) computes the spectrum at these frequencies exactly.
//! Source: W. Zhang, H. Zhang and G. Jin, Optics Letters 45, 1543 (2020); they use the paraxial form and a non-uniform
//! Fourier transform.

use super::frequency_window::FrequencyAxis;
use crate::display::OpticalSetup;

/// The frequencies of the band-extended method along x and y.
pub(crate) fn band_extended_axes(setup: &OpticalSetup) -> [FrequencyAxis; 2] {
    let axis = |padded_px: usize| {
        let samples = padded_px as f64;
        let nyquist = 0.5 / setup.grid().pixel_pitch_m();
        let limit = extended_limit(samples, setup.wavelength_m(), setup.distance_m()).min(nyquist);
        let spacing_per_m = 2.0 * limit / samples;
        let reach_m = 0.5 / spacing_per_m;
        FrequencyAxis { first: -samples / 2.0, count: padded_px, spacing_per_m, whole_m: reach_m, reach_m }
    };
    [axis(setup.padded_width_px()), axis(setup.padded_height_px())]
}

/// Limit f_ext of the band \[1/m\]: the root of f⁴ = c²(1/λ² − f²), c = N/4|z|, in a form that avoids cancellation.
fn extended_limit(samples: f64, wavelength_m: f64, distance_m: f64) -> f64 {
    let c = 0.25 * samples / distance_m.abs();
    let root = (0.25 * c * c + wavelength_m.powi(-2)).sqrt() + 0.5 * c;
    (c * wavelength_m.powi(-2) / root).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Grid;

    #[test]
    fn phase_changes_by_half_cycle_at_extended_limit() {
        for (samples, z) in [(2160.0, 0.5), (64.0, -0.02), (200.0, 1e-5)] {
            let f = extended_limit(samples, 515e-9, z);
            let turns = z.abs() * f / (515e-9_f64.powi(-2) - f * f).sqrt() * 2.0 * f / samples;
            assert!((turns - 0.5).abs() < 1e-9, "{samples} {z}: {turns}");
        }
        let paraxial = 0.5 * (2160.0_f64 / (515e-9 * 0.5)).sqrt();
        assert!((extended_limit(2160.0, 515e-9, 0.5) / paraxial - 1.0).abs() < 1e-3);
    }

    #[test]
    fn extended_band_is_wider_by_published_factor() {
        let setup = OpticalSetup::try_new(Grid::try_new(1080, 1920, 8e-6).unwrap(), 515e-9, 2.0).unwrap();
        let [along_x, along_y] = band_extended_axes(&setup);
        let limited = |extent_m: f64| 1.0 / (515e-9 * ((4.0 / extent_m).powi(2) + 1.0).sqrt());
        for (axis, extent_m, critical_m) in [
            (along_x, 3840.0 * 8e-6, setup.critical_distance_x_m()),
            (along_y, 2160.0 * 8e-6, setup.critical_distance_y_m()),
        ] {
            let wider = -axis.at(0) / limited(extent_m);
            assert!((wider / (2.0 / critical_m).sqrt() - 1.0).abs() < 1e-3, "{wider}");
        }
        let near = OpticalSetup::try_new(setup.grid(), 515e-9, 0.15).unwrap();
        assert!((band_extended_axes(&near)[0].at(0) + 62_500.0).abs() < 1e-6);
    }
}
