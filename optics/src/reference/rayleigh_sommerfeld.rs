//! Diffraction as a direct sum.
//!
//! ```text
//! u₁(x, y) = Δ² Σ u₀(x', y') · z/(2πr²) · (1/r − ik) · e^{ik(r − z)},   r² = (x − x')² + (y − y')² + z²
//! ```
//!
//! The first Rayleigh–Sommerfeld integral in the time convention e^{−iωt}, without the piston e^{ikz}, as the transfer
//! functions of this crate. k = 2π/λ, Δ pixel pitch \[m\]. r − z = ρ²/(r + z) avoids cancellation. The sum samples the
//! integral well enough for z > z_c (see [`OpticalSetup::critical_distance_x_m`]).

use crate::transfer_function::phasor;
use crate::{OpticalSetup, Plane, Result};
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The field at the setup's distance, in O(pixels²). Towards negative distances it is the field that would become
/// `field`, without its evanescent part.
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) when `field` is not of the size of the setup's grid.
pub fn rayleigh_sommerfeld(setup: &OpticalSetup, field: &Plane<Complex64>) -> Result<Plane<Complex64>> {
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    field.expect_size("field", height_px, width_px)?;
    let backwards = setup.distance_m() < 0.0;
    let turned = |value: Complex64| if backwards { value.conj() } else { value };
    let values = (0..height_px * width_px)
        .into_par_iter()
        .map(|pixel| {
            let (y, x) = (pixel / width_px, pixel % width_px);
            let mut sum = Complex64::ZERO;
            for source_y in 0..height_px {
                for (source_x, &value) in field.row(source_y).iter().enumerate() {
                    sum += turned(value) * impulse_response(setup, y.abs_diff(source_y), x.abs_diff(source_x));
                }
            }
            turned(sum) * setup.grid().pixel_pitch_m().powi(2)
        })
        .collect();
    Plane::try_from_vec(height_px, width_px, values)
}

/// h(x, y) \[1/m²\] a whole number of pixels away, for |z|.
fn impulse_response(setup: &OpticalSetup, y_px: usize, x_px: usize) -> Complex64 {
    let (pitch_m, wavelength_m, z) = (setup.grid().pixel_pitch_m(), setup.wavelength_m(), setup.distance_m().abs());
    let rho_squared = (y_px as f64 * pitch_m).powi(2) + (x_px as f64 * pitch_m).powi(2);
    let r = (rho_squared + z * z).sqrt();
    let obliquity = z / (TAU * r * r) * Complex64::new(1.0 / r, -TAU / wavelength_m);
    obliquity * phasor(rho_squared / ((r + z) * wavelength_m))
}
