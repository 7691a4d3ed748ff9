//! Diffraction as a direct sum.
//!
//! ```text
//! u₁(x, y) = Δ² Σ u₀(x', y') · z/(2πr²) · (1/r − ik) · e^{ik(r − z)},   r² = (x − x')² + (y − y')² + z²
//! ```
//!
//! This is the first Rayleigh–Sommerfeld integral in the time convention e^{−iωt}. Like the transfer functions of this
//! crate, it leaves out the piston e^{ikz}. k = 2π/λ, Δ pixel pitch \[m\]. The form r − z = ρ²/(r + z), ρ² = r² − z²,
//! avoids cancellation. The sum samples the integral finely enough where the phase of e^{ikr} changes by less than half
//! a cycle from pixel to pixel. On the display's own window that holds for z > z_c (see
//! [`OpticalSetup::critical_distance_x_m`]). To judge nearer images sample the field more finely: for a given size of
//! the display z_c is proportional to Δ. Source: J. Goodman, Introduction to Fourier Optics, section 3.5.

use crate::display::OpticalSetup;
use crate::error::Result;
use crate::numerics::Plane;
use crate::propagation::{ImageWindow, impulse_response};
use num_complex::Complex64;
use rayon::prelude::*;

/// The field at the setup's distance on the display's own pixels, computed in O(pixels²). For a negative distance it is
/// the field that would propagate into `field`, without the evanescent part.
///
/// ```
/// use lightpath_optics::reference::rayleigh_sommerfeld;
/// use lightpath_optics::{Grid, OpticalSetup, Plane};
/// use num_complex::Complex64;
///
/// let setup = OpticalSetup::try_new(Grid::try_new(24, 24, 8e-6)?, 515e-9, 8e-3)?;
/// let spot = Plane::from_fn(24, 24, |y, x| {
///     Complex64::from((-((y as f64 - 11.5).powi(2) + (x as f64 - 11.5).powi(2)) / 18.0).exp())
/// });
/// let image = rayleigh_sommerfeld(&setup, &spot)?;
/// let light = |plane: &Plane<Complex64>| plane.values().iter().map(|u| u.norm_sqr()).sum::<f64>();
/// assert!(image.at(12, 12).norm() < spot.at(12, 12).norm(), "the spot spreads");
/// assert!((light(&image) / light(&spot) - 1.0).abs() < 0.05, "little light leaves the frame");
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) when the size of `field` differs from the setup's grid.
pub fn rayleigh_sommerfeld(setup: &OpticalSetup, field: &Plane<Complex64>) -> Result<Plane<Complex64>> {
    rayleigh_sommerfeld_onto(setup, field, &ImageWindow::of(&setup.grid()))
}

/// The field at the setup's distance in any window, computed in O(pixels · the window's pixels). The setup's method and
/// centre are ignored.
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) when the size of `field` differs from the setup's grid.
pub fn rayleigh_sommerfeld_onto(
    setup: &OpticalSetup,
    field: &Plane<Complex64>,
    window: &ImageWindow,
) -> Result<Plane<Complex64>> {
    let grid = setup.grid();
    field.expect_size("field", grid.height_px(), grid.width_px())?;
    let source = ImageWindow::of(&grid);
    let columns_m: Vec<f64> = (0..grid.width_px()).map(|x| source.x_m(x)).collect();
    let values = (0..window.height_px() * window.width_px())
        .into_par_iter()
        .map(|pixel| {
            let (y, x) = (pixel / window.width_px(), pixel % window.width_px());
            let mut sum = Complex64::ZERO;
            for source_y in 0..grid.height_px() {
                let dy_m = window.y_m(y) - source.y_m(source_y);
                for (&value, &column_m) in field.row(source_y).iter().zip(&columns_m) {
                    let dx_m = window.x_m(x) - column_m;
                    sum += value * impulse_response(dx_m, dy_m, setup.wavelength_m(), setup.distance_m());
                }
            }
            sum * grid.pixel_pitch_m().powi(2)
        })
        .collect();
    Plane::try_from_vec(window.height_px(), window.width_px(), values)
}
