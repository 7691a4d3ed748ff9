//! Fresnel diffraction by its transfer function.
//!
//! ```text
//! H(fx, fy) = e^{−iπλz(fx² + fy²)}
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], fx, fy spatial frequency \[1/m\]; the piston e^{ikz} is left out. It is the first term
//! in λ²f² of the phase of the [angular spectrum](crate::transfer_function), and what it leaves out is 2πz·λ³f⁴/8 and less. Its
//! samples alias beyond z_c as the angular spectrum's do. J. Goodman, Introduction to Fourier Optics, section 4.2.

use crate::transfer_function::phasor;
use num_complex::Complex64;

/// The paraxial transfer function of free space, without its piston.
///
/// ```
/// use lightpath_optics::propagation::fresnel_transfer_function;
/// use lightpath_optics::transfer_function::angular_spectrum;
/// let paraxial = fresnel_transfer_function(2e4, 0.0, 515e-9, 0.1);
/// assert!((paraxial - angular_spectrum(2e4, 0.0, 515e-9, 0.1)).norm() < 2e-3);
/// ```
#[must_use]
pub fn fresnel_transfer_function(fx: f64, fy: f64, wavelength_m: f64, distance_m: f64) -> Complex64 {
    phasor(-0.5 * wavelength_m * distance_m * (fx * fx + fy * fy))
}

/// By how much \[rad\] the phase that is taken for the true one misses it at frequency `f` \[1/m\].
pub(super) fn neglected_phase_rad(f: f64, wavelength_m: f64, distance_m: f64) -> f64 {
    let sine_squared = (wavelength_m * f).powi(2).min(1.0);
    let exact = sine_squared / (1.0 + (1.0 - sine_squared).sqrt());
    std::f64::consts::TAU * (distance_m / wavelength_m).abs() * (exact - sine_squared / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer_function::angular_spectrum;

    #[test]
    fn it_misses_the_angular_spectrum_by_what_it_neglects() {
        let (wavelength_m, distance_m) = (515e-9, 0.15);
        for f in [0.0, 1e4, 6.25e4, 2e5] {
            let apart = fresnel_transfer_function(f, 0.0, wavelength_m, distance_m)
                / angular_spectrum(f, 0.0, wavelength_m, distance_m);
            let neglected = neglected_phase_rad(f, wavelength_m, distance_m);
            assert!((apart - Complex64::cis(neglected)).norm() < 1e-7, "{f}: {neglected}");
        }
        // 2πz·λ³f⁴/8, and higher orders of a part in thousands.
        let first_order = std::f64::consts::TAU * distance_m * wavelength_m.powi(3) * 6.25e4_f64.powi(4) / 8.0;
        assert!((neglected_phase_rad(6.25e4, wavelength_m, distance_m) / first_order - 1.0).abs() < 1e-3);
    }
}
