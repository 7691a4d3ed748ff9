//! Fresnel diffraction by its impulse response, sampled in space.
//!
//! ```text
//! u₁ = Δ² Σ u₀(x', y') h(x − x', y − y'),   h(x, y) = e^{iπ(x² + y²)/λz} / (iλz)
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], Δ pixel pitch \[m\], h \[1/m²\]; the piston e^{ikz} is left out. The sum is
//! computed as a convolution on the padded grid. h separates into a factor along x and a factor along y, and so does
//! its transform. The phase of a factor changes by N·Δ²/λz of a cycle from pixel to pixel at the far end of the frame.
//! For z ≥ z_c this is at most half a cycle, which avoids aliasing. Source: D. Voelz and M. Roggemann, Applied Optics
//! 48, 6132 (2009).

use super::transfer_function::phasor;
use lightpath_fft::FftPlanner;
use num_complex::Complex64;
use std::f64::consts::{FRAC_PI_4, TAU};

/// Paraxial impulse response h(x, y) \[1/m²\] of free space, without the piston.
///
/// ```
/// use lightpath_optics::propagation::fresnel_impulse_response;
/// let middle = fresnel_impulse_response(0.0, 0.0, 500e-9, 0.1);
/// assert!((middle.im + 1.0 / (500e-9 * 0.1)).abs() < 1e-3);
/// ```
#[must_use]
pub fn fresnel_impulse_response(x_m: f64, y_m: f64, wavelength_m: f64, distance_m: f64) -> Complex64 {
    along_axis(x_m, wavelength_m, distance_m) * along_axis(y_m, wavelength_m, distance_m)
}

/// The factor of h along one axis \[1/m\]: e^{iπx²/λz}/√(iλz).
fn along_axis(x_m: f64, wavelength_m: f64, distance_m: f64) -> Complex64 {
    let area_m2 = wavelength_m * distance_m;
    let root = Complex64::cis(-FRAC_PI_4 * area_m2.signum()) / area_m2.abs().sqrt();
    root * phasor(0.5 * x_m * x_m / area_m2)
}

/// Fourier transform of Δ·h along an axis of `samples` pixels, at the 2·`samples` padded bins in the order of the DFT.
pub(super) fn spectrum_along_axis(
    samples: usize,
    pixel_pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
) -> Vec<Complex64> {
    let mut spectrum = vec![Complex64::ZERO; 2 * samples];
    for lag in 0..samples {
        let value = pixel_pitch_m * along_axis(lag as f64 * pixel_pitch_m, wavelength_m, distance_m);
        spectrum[lag] = value;
        // No two pixels are `samples` pixels apart: that bin stays zero.
        if lag > 0 {
            spectrum[2 * samples - lag] = value;
        }
    }
    FftPlanner::new().plan_fft_forward(2 * samples).process(&mut spectrum);
    spectrum
}

/// Transfer function of the sampled impulse response at any frequency \[1/m\], computed from its definition.
pub(crate) fn fresnel_impulse_spectrum(
    f: f64,
    samples: usize,
    pixel_pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
) -> Complex64 {
    let term = |lag: usize| {
        let x_m = lag as f64 * pixel_pitch_m;
        let pair = if lag == 0 { 1.0 } else { 2.0 * (TAU * f * x_m).cos() };
        along_axis(x_m, wavelength_m, distance_m) * pair
    };
    (0..samples).map(term).sum::<Complex64>() * pixel_pitch_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::grid::frequency;

    #[test]
    fn fast_spectrum_matches_definition() {
        for samples in [1, 2, 7, 30] {
            let fast = spectrum_along_axis(samples, 8e-6, 515e-9, -0.02);
            for (bin, fast) in fast.iter().enumerate() {
                let plain = fresnel_impulse_spectrum(frequency(bin, 2 * samples, 8e-6), samples, 8e-6, 515e-9, -0.02);
                assert!((fast - plain).norm() < 1e-12, "{samples} {bin}");
            }
        }
    }

    #[test]
    fn sampled_response_matches_transfer_function_at_large_distance() {
        // Frequencies whose light lands in the frame, away from the ringing at the ends of the response.
        let (samples, pitch_m, distance_m) = (4096, 8e-6, 3.0);
        let f = 3e3;
        let sampled = fresnel_impulse_spectrum(f, samples, pitch_m, 515e-9, distance_m);
        let exact = super::super::fresnel_transfer_function(f, 0.0, 515e-9, distance_m);
        assert!((sampled - exact).norm() < 0.05, "{sampled} {exact}");
    }

    #[test]
    fn opposite_distances_give_conjugate_values() {
        let there = fresnel_impulse_response(1e-4, -3e-4, 515e-9, 0.2);
        assert!((fresnel_impulse_response(1e-4, -3e-4, 515e-9, -0.2) - there.conj()).norm() < 1e-9 * there.norm());
    }
}
