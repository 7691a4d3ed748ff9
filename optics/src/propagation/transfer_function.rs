//! Transfer function of free space: the angular spectrum method and its band limit.
//!
//! ```text
//! H(fx, fy) = exp(i 2π z (√(1/λ² − f²) − 1/λ)) = exp(−i 2π z λ f² / (1 + √(1 − λ² f²))),   f² = fx² + fy²
//! ```
//!
//! λ is the wavelength \[m\], z the distance \[m\], fx and fy the spatial frequency \[1/m\]. The piston e^{ikz} is
//! omitted: it does not change the intensity, and without it the phase stays small enough to be exact. The second form
//! has no cancellation at small f. Band limit: K. Matsushima and T. Shimobaba, Optics Express 17, 19662 (2009).

use num_complex::Complex64;
use std::f64::consts::TAU;

/// Transfer function of the ideal angular spectrum, without its piston.
///
/// Evanescent waves (λ²f² > 1) decay for positive `distance_m`. For negative distances they are removed, since they
/// would grow without bound.
///
/// ```
/// use lightpath_optics::propagation::transfer_function::angular_spectrum;
/// assert_eq!(angular_spectrum(0.0, 0.0, 515e-9, 0.15).re, 1.0);
/// assert!((angular_spectrum(5e4, -2e4, 515e-9, 0.15).norm() - 1.0).abs() < 1e-15);
/// assert_eq!(angular_spectrum(2e6, 0.0, 515e-9, -0.15).norm(), 0.0);
/// ```
#[must_use]
pub fn angular_spectrum(fx: f64, fy: f64, wavelength_m: f64, distance_m: f64) -> Complex64 {
    let f_squared = fx * fx + fy * fy;
    let sine_squared = wavelength_m * wavelength_m * f_squared;
    if sine_squared <= 1.0 {
        return phasor(-distance_m * wavelength_m * f_squared / (1.0 + (1.0 - sine_squared).sqrt()));
    }
    if distance_m < 0.0 {
        return Complex64::ZERO;
    }
    let decay = (-TAU * distance_m / wavelength_m * (sine_squared - 1.0).sqrt()).exp();
    phasor(-distance_m / wavelength_m) * decay
}

/// Whether the sampled transfer function is free of aliasing at this frequency.
///
/// Evaluates both of Matsushima's inequalities, in their exact form:
///
/// ```text
/// (fx/fx_lim)² + (λ fy)² ≤ 1  and  (fy/fy_lim)² + (λ fx)² ≤ 1,   fx_lim = 1 / (λ √((2z/(N_x Δ))² + 1))
/// ```
///
/// `padded_extent_x_m` and `padded_extent_y_m` are the padded sides N_x·Δ and N_y·Δ \[m\]. Evanescent waves always fail
/// the check.
#[must_use]
pub fn band_limit(
    fx: f64,
    fy: f64,
    wavelength_m: f64,
    distance_m: f64,
    padded_extent_x_m: f64,
    padded_extent_y_m: f64,
) -> bool {
    let (sine_x, sine_y) = (wavelength_m * fx, wavelength_m * fy);
    let inverse_limit_squared = |extent_m: f64| (2.0 * distance_m / extent_m).powi(2) + 1.0;
    sine_x * sine_x * inverse_limit_squared(padded_extent_x_m) + sine_y * sine_y <= 1.0
        && sine_y * sine_y * inverse_limit_squared(padded_extent_y_m) + sine_x * sine_x <= 1.0
}

/// Computes e^{i2π·cycles} after subtracting whole cycles.
pub(crate) fn phasor(cycles: f64) -> Complex64 {
    Complex64::cis(TAU * (cycles - cycles.round()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAVELENGTH_M: f64 = 515e-9;

    #[test]
    fn both_forms_of_the_phase_agree() {
        let distance_m: f64 = 1e-3;
        for (fx, fy) in [(0.0, 0.0), (1e3, 2e3), (6.25e4, 6.25e4), (1.2e6, -9e5), (1.94e6, 0.0)] {
            let direct = (WAVELENGTH_M.powi(-2) - fx * fx - fy * fy).sqrt() - WAVELENGTH_M.recip();
            let expected = Complex64::cis(TAU * distance_m * direct);
            assert!((angular_spectrum(fx, fy, WAVELENGTH_M, distance_m) - expected).norm() < 1e-8, "{fx} {fy}");
        }
    }

    #[test]
    fn evanescent_waves_decay_forwards_and_vanish_backwards() {
        let (fx, distance_m) = (2.5e6, 1e-7);
        let expected = (-TAU * distance_m * (fx * fx - WAVELENGTH_M.powi(-2)).sqrt()).exp();
        assert!((angular_spectrum(fx, 0.0, WAVELENGTH_M, distance_m).norm() - expected).abs() < 1e-12);
        assert_eq!(angular_spectrum(fx, 0.0, WAVELENGTH_M, -distance_m), Complex64::ZERO);
        // The transfer function is continuous where waves become evanescent.
        let edge = 1.0 / WAVELENGTH_M;
        let (inside, outside) = (edge * (1.0 - 1e-13), edge * (1.0 + 1e-13));
        let jump = angular_spectrum(inside, 0.0, WAVELENGTH_M, distance_m)
            - angular_spectrum(outside, 0.0, WAVELENGTH_M, distance_m);
        assert!(jump.norm() < 1e-5);
    }

    #[test]
    fn opposite_distances_give_conjugate_values() {
        let there = angular_spectrum(3e4, -5e4, WAVELENGTH_M, 0.2);
        assert_eq!(angular_spectrum(3e4, -5e4, WAVELENGTH_M, -0.2), there.conj());
    }

    #[test]
    fn band_limit_matches_published_limit() {
        let (extent_m, distance_m): (f64, f64) = (2160.0 * 8e-6, 0.5);
        let limit = 1.0 / (WAVELENGTH_M * ((2.0 * distance_m / extent_m).powi(2) + 1.0).sqrt());
        let kept = |fx: f64, fy: f64| band_limit(fx, fy, WAVELENGTH_M, distance_m, extent_m, extent_m);
        assert!(kept(limit * 0.999_999, 0.0) && !kept(limit * 1.000_001, 0.0));
        assert!(kept(0.0, -limit * 0.999_999) && !kept(0.0, -limit * 1.000_001));
        assert!(kept(limit * 0.99, limit * 0.99));
        assert!(!band_limit(1.9e6, 0.6e6, WAVELENGTH_M, 1e-9, extent_m, extent_m), "evanescent");
    }
}
