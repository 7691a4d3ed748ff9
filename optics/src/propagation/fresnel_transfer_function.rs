//! Fresnel diffraction by its transfer function.
//!
//! ```text
//! H(fx, fy) = e^{−iπλz(fx² + fy²)}
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], fx, fy spatial frequency \[1/m\]; the piston e^{ikz} is left out. The phase of
//! H is the first term of the phase of the [angular spectrum](crate::propagation::transfer_function) in powers of λ²f². The largest
//! neglected term is 2πz·λ³f⁴/8. The samples of H alias beyond z_c, as those of the angular spectrum do.
//! Source: J. Goodman, Introduction to Fourier Optics, section 4.2.

use super::transfer_function::phasor;
use num_complex::Complex64;

/// The paraxial transfer function of free space, without the piston. fx, fy in 1/m, wavelength and distance in m.
///
/// ```
/// use lightpath_optics::propagation::fresnel_transfer_function;
/// use lightpath_optics::propagation::transfer_function::angular_spectrum;
/// let paraxial = fresnel_transfer_function(2e4, 0.0, 515e-9, 0.1);
/// assert!((paraxial - angular_spectrum(2e4, 0.0, 515e-9, 0.1)).norm() < 2e-3);
/// ```
#[must_use]
pub fn fresnel_transfer_function(fx: f64, fy: f64, wavelength_m: f64, distance_m: f64) -> Complex64 {
    phasor(-0.5 * wavelength_m * distance_m * (fx * fx + fy * fy))
}

/// Error \[rad\] of the paraxial phase at frequency `f` \[1/m\].
pub(super) fn neglected_phase_rad(f: f64, wavelength_m: f64, distance_m: f64) -> f64 {
    let sine_squared = (wavelength_m * f).powi(2).min(1.0);
    let exact = sine_squared / (1.0 + (1.0 - sine_squared).sqrt());
    std::f64::consts::TAU * (distance_m / wavelength_m).abs() * (exact - sine_squared / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propagation::transfer_function::angular_spectrum;

    #[test]
    fn error_against_angular_spectrum_is_neglected_phase() {
        let (wavelength_m, distance_m) = (515e-9, 0.15);
        for f in [0.0, 1e4, 6.25e4, 2e5] {
            let ratio = fresnel_transfer_function(f, 0.0, wavelength_m, distance_m)
                / angular_spectrum(f, 0.0, wavelength_m, distance_m);
            let neglected = neglected_phase_rad(f, wavelength_m, distance_m);
            assert!((ratio - Complex64::cis(neglected)).norm() < 1e-7, "{f}: {neglected}");
        }
        // 2πz·λ³f⁴/8; the higher orders are some thousandths of it.
        let first_order = std::f64::consts::TAU * distance_m * wavelength_m.powi(3) * 6.25e4_f64.powi(4) / 8.0;
        assert!((neglected_phase_rad(6.25e4, wavelength_m, distance_m) / first_order - 1.0).abs() < 1e-3);
    }
}
