//! The far field: one Fourier transform and a quadratic phase.
//!
//! ```text
//! u₁(x, y) = e^{iπ(x² + y²)/λz} / (iλz) · Δ² Σ u₀(x', y') e^{−i2π(x·x' + y·y')/λz}
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], Δ pixel pitch \[m\]; the piston e^{ikz} is left out. Along each axis of N
//! pixels the samples of the image are λz/(NΔ) apart, which makes the sum a discrete Fourier transform. The method
//! neglects the phase π(x'² + y'²)/λz across the display and therefore needs z > 2D²/λ, with D the display's diagonal.
//! Far off the axis the phase of u₁ has the error of a paraboloid in place of a sphere; the intensity does not. Source:
//! J. Goodman, Introduction to Fourier Optics, section 4.3.

use super::rows::{transform_rows, transposed};
use super::transfer_function::phasor;
use crate::display::image_window::from_middle;
use crate::display::{ImageWindow, OpticalSetup};
use crate::numerics::Plane;
use crate::numerics::real::Number;
use lightpath_fft::{Fft, FftPlanner};
use num_complex::{Complex, Complex64};
use std::{fmt, sync::Arc};

/// The window on which the far field of a setup is sampled. It has as many pixels as the display, λz/(NΔ) apart.
#[must_use]
pub fn fraunhofer_window(setup: &OpticalSetup) -> ImageWindow {
    let grid = setup.grid();
    let pitch_m =
        |side_px: usize| setup.wavelength_m() * setup.distance_m().abs() / (side_px as f64 * grid.pixel_pitch_m());
    ImageWindow::with_pitches(&grid, pitch_m(grid.width_px()), pitch_m(grid.height_px()))
}

/// Difference \[rad\] of the neglected phase between the display's middle and its corners.
pub(super) fn neglected_phase_rad(setup: &OpticalSetup) -> f64 {
    let grid = setup.grid();
    let half_diagonal_m =
        0.5 * grid.pixel_pitch_m() * ((grid.width_px() - 1) as f64).hypot((grid.height_px() - 1) as f64);
    std::f64::consts::PI * half_diagonal_m * half_diagonal_m / (setup.wavelength_m() * setup.distance_m().abs())
}

/// Planned far-field propagation.
#[derive(Debug)]
pub(crate) struct Fraunhofer<T> {
    along_x: Axis<T>,
    along_y: Axis<T>,
    backwards: bool,
}

/// Transforms and factors along one axis of N samples.
struct Axis<T> {
    forward: Arc<dyn Fft<T>>,
    inverse: Arc<dyn Fft<T>>,
    /// e^{i2πn(N−1)/2N}: moves position 0 to the middle, before and after the transform.
    ramp: Vec<Complex<T>>,
    /// Δ/√(iλz) · e^{iπx²/λz}, times the constant phase that the two ramps leave.
    quadratic: Vec<Complex<T>>,
}

impl<T> fmt::Debug for Axis<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Axis({})", self.ramp.len())
    }
}

impl<T: Number> Fraunhofer<T> {
    pub(crate) fn new(setup: &OpticalSetup) -> Self {
        let (grid, mut planner) = (setup.grid(), FftPlanner::new());
        let area_m2 = setup.wavelength_m() * setup.distance_m().abs();
        let mut axis = |samples| Axis::new(&mut planner, samples, grid.pixel_pitch_m(), area_m2);
        Self { along_x: axis(grid.width_px()), along_y: axis(grid.height_px()), backwards: setup.distance_m() < 0.0 }
    }

    pub(crate) fn forward(&self, field: &Plane<Complex<T>>) -> Plane<Complex<T>> {
        self.conjugated_if_backwards(field, |field| self.along_both(field, Axis::forward))
    }

    pub(crate) fn adjoint(&self, field: &Plane<Complex<T>>) -> Plane<Complex<T>> {
        self.conjugated_if_backwards(field, |field| self.along_both(field, Axis::adjoint))
    }

    /// Runs `forwards`. For a negative distance it conjugates the field before and after.
    fn conjugated_if_backwards(
        &self,
        field: &Plane<Complex<T>>,
        forwards: impl Fn(&Plane<Complex<T>>) -> Plane<Complex<T>>,
    ) -> Plane<Complex<T>> {
        if self.backwards { forwards(&field.map(|u| u.conj())).map(|u| u.conj()) } else { forwards(field) }
    }

    fn along_both(
        &self,
        field: &Plane<Complex<T>>,
        along: impl Fn(&Axis<T>, &[Complex<T>], &mut [Complex<T>]) + Sync,
    ) -> Plane<Complex<T>> {
        let (height, width) = (field.height_px(), field.width_px());
        let rows = transform_rows(field.values(), width, width, || (), |row, out, ()| along(&self.along_x, row, out));
        let columns = transposed(&rows, width);
        let columns = transform_rows(&columns, height, height, || (), |row, out, ()| along(&self.along_y, row, out));
        let values = transposed(&columns, height);
        Plane::try_from_vec(height, width, values).expect("as many values as before")
    }
}

impl<T: Number> Axis<T> {
    fn new(planner: &mut FftPlanner<T>, samples: usize, pixel_pitch_m: f64, area_m2: f64) -> Self {
        let narrow = |value: Complex64| Complex::new(T::of(value.re), T::of(value.im));
        let n = samples as f64;
        let middle = (n - 1.0) / 2.0;
        let image_pitch_m = area_m2 / (n * pixel_pitch_m);
        let scale = pixel_pitch_m / area_m2.sqrt();
        let quadratic = |i: usize| {
            let x_m = from_middle(i, samples) * image_pitch_m;
            // −1/8 of a cycle is the phase of 1/√i.
            narrow(scale * phasor(0.5 * x_m * x_m / area_m2 - 0.125 - middle * middle / n))
        };
        Self {
            forward: planner.plan_fft_forward(samples),
            inverse: planner.plan_fft_inverse(samples),
            ramp: (0..samples).map(|i| narrow(phasor(i as f64 * middle / n))).collect(),
            quadratic: (0..samples).map(quadratic).collect(),
        }
    }

    fn forward(&self, row: &[Complex<T>], out: &mut [Complex<T>]) {
        for ((out, &value), &ramp) in out.iter_mut().zip(row).zip(&self.ramp) {
            *out = value * ramp;
        }
        self.forward.process(out);
        for ((out, &ramp), &quadratic) in out.iter_mut().zip(&self.ramp).zip(&self.quadratic) {
            *out = *out * ramp * quadratic;
        }
    }

    fn adjoint(&self, row: &[Complex<T>], out: &mut [Complex<T>]) {
        for (((out, &value), &ramp), &quadratic) in out.iter_mut().zip(row).zip(&self.ramp).zip(&self.quadratic) {
            *out = value * (ramp * quadratic).conj();
        }
        self.inverse.process(out);
        for (out, &ramp) in out.iter_mut().zip(&self.ramp) {
            *out = *out * ramp.conj();
        }
    }
}
