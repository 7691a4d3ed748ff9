//! Fresnel diffraction onto a window of any pitch, size and position.
//!
//! ```text
//! u₁(x, y) = e^{iπ(x² + y²)/λz} / (iλz) · Δ² Σ u₀(x', y') e^{iπ(x'² + y'²)/λz} e^{−i2π(x·x' + y·y')/λz}
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], Δ pixel pitch \[m\]; the piston e^{ikz} is left out. The sum is a [chirp-z
//! transform](super::chirp_z) along one axis, then along the other. The samples are fine enough where every pixel
//! reaches every point of the window: |x − x'| ≤ λz/2Δ. There the phase factors of the sum change by at most half a
//! cycle from pixel to pixel.
//! Sources: J. Goodman, Introduction to Fourier Optics, section 4.2; with chirp-z transforms: Y. Hu et al., Light:
//! Science & Applications 9, 119 (2020).

use super::chirp_z::{ChirpZ, Sign, Span};
use super::rows::{transform_rows, transposed};
use super::transfer_function::phasor;
use crate::display::image_window::from_middle;
use crate::display::{ImageWindow, OpticalSetup};
use crate::numerics::Plane;
use crate::numerics::real::Number;
use lightpath_fft::FftPlanner;
use num_complex::{Complex, Complex64};

/// Largest distance \[m\] between a point of the window and a pixel of the display, along x and along y.
pub(super) fn farthest_m(setup: &OpticalSetup, window: &ImageWindow) -> (f64, f64) {
    let (grid, pitch_m) = (setup.grid(), setup.grid().pixel_pitch_m());
    let half = |side_px: usize, pitch_m: f64| 0.5 * (side_px as f64 - 1.0) * pitch_m;
    (
        window.centre_x_m().abs() + half(window.width_px(), window.pitch_x_m()) + half(grid.width_px(), pitch_m),
        window.centre_y_m().abs() + half(window.height_px(), window.pitch_y_m()) + half(grid.height_px(), pitch_m),
    )
}

/// Planned Fresnel propagation in a single step.
#[derive(Debug)]
pub(crate) struct ScaledFresnel<T> {
    along_x: Axis<T>,
    along_y: Axis<T>,
    backwards: bool,
}

#[derive(Debug)]
struct Axis<T> {
    /// Factors before the transform: Δ/√(iλz) · e^{iπx'²/λz} · e^{−i2πx'·x₀/λz}, with x₀ the window's middle.
    before: Vec<Complex<T>>,
    to_window: ChirpZ<T>,
    from_window: ChirpZ<T>,
    /// Factors after the transform: e^{iπx²/λz}.
    after: Vec<Complex<T>>,
}

impl<T: Number> ScaledFresnel<T> {
    pub(crate) fn new(setup: &OpticalSetup, window: &ImageWindow) -> Self {
        let (grid, mut planner) = (setup.grid(), FftPlanner::new());
        let area_m2 = setup.wavelength_m() * setup.distance_m().abs();
        let mut axis = |side_px: usize, window_px: usize, window_pitch_m: f64, centre_m: f64| {
            let pitch_m = grid.pixel_pitch_m();
            let narrow = |value: Complex64| Complex::new(T::of(value.re), T::of(value.im));
            let before = |i: usize| {
                let x_m = from_middle(i, side_px) * pitch_m;
                // −1/8 of a cycle is the phase of 1/√i.
                narrow(pitch_m / area_m2.sqrt() * phasor((0.5 * x_m * x_m - x_m * centre_m) / area_m2 - 0.125))
            };
            let after = |i: usize| {
                let x_m = centre_m + from_middle(i, window_px) * window_pitch_m;
                narrow(phasor(0.5 * x_m * x_m / area_m2))
            };
            let (from, to) = (Span::centred(side_px), Span::centred(window_px));
            let spacing_cycles = pitch_m * window_pitch_m / area_m2;
            Axis {
                before: (0..side_px).map(before).collect(),
                to_window: ChirpZ::new(&mut planner, from, to, spacing_cycles, Sign::Minus),
                from_window: ChirpZ::new(&mut planner, to, from, spacing_cycles, Sign::Plus),
                after: (0..window_px).map(after).collect(),
            }
        };
        Self {
            along_x: axis(grid.width_px(), window.width_px(), window.pitch_x_m(), window.centre_x_m()),
            along_y: axis(grid.height_px(), window.height_px(), window.pitch_y_m(), window.centre_y_m()),
            backwards: setup.distance_m() < 0.0,
        }
    }

    pub(crate) fn forward(&self, field: &Plane<Complex<T>>) -> Plane<Complex<T>> {
        self.conjugated_if_backwards(field, |field| {
            let rows = self.along_x.forward(field.values());
            let columns = self.along_y.forward(&transposed(&rows, self.along_x.after.len()));
            (self.along_y.after.len(), self.along_x.after.len(), transposed(&columns, self.along_y.after.len()))
        })
    }

    pub(crate) fn adjoint(&self, field: &Plane<Complex<T>>) -> Plane<Complex<T>> {
        self.conjugated_if_backwards(field, |field| {
            let rows = self.along_x.adjoint(field.values());
            let columns = self.along_y.adjoint(&transposed(&rows, self.along_x.before.len()));
            (self.along_y.before.len(), self.along_x.before.len(), transposed(&columns, self.along_y.before.len()))
        })
    }

    /// Runs `forwards`. For a negative distance it conjugates the field before and after.
    fn conjugated_if_backwards(
        &self,
        field: &Plane<Complex<T>>,
        forwards: impl Fn(&Plane<Complex<T>>) -> (usize, usize, Vec<Complex<T>>),
    ) -> Plane<Complex<T>> {
        let (height, width, values) = if self.backwards { forwards(&field.map(|u| u.conj())) } else { forwards(field) };
        let result = Plane::try_from_vec(height, width, values).expect("one value for each sample");
        if self.backwards { result.map(|u| u.conj()) } else { result }
    }
}

impl<T: Number> Axis<T> {
    fn forward(&self, rows: &[Complex<T>]) -> Vec<Complex<T>> {
        self.each_row(rows, &self.before, |u, by| u * by, &self.to_window, &self.after)
    }

    fn adjoint(&self, rows: &[Complex<T>]) -> Vec<Complex<T>> {
        self.each_row(rows, &self.after, |u, by| u * by.conj(), &self.from_window, &self.before)
    }

    /// Multiplies each row by its factors, transforms it, and multiplies it by the second factors.
    fn each_row(
        &self,
        rows: &[Complex<T>],
        before: &[Complex<T>],
        apply: impl Fn(Complex<T>, Complex<T>) -> Complex<T> + Sync,
        chirp_z: &ChirpZ<T>,
        after: &[Complex<T>],
    ) -> Vec<Complex<T>> {
        let zeros = || vec![Complex::new(T::zero(), T::zero()); before.len()];
        transform_rows(
            rows,
            before.len(),
            after.len(),
            || (zeros(), chirp_z.scratch()),
            |row, out, (work, scratch)| {
                for ((work, &value), &by) in work.iter_mut().zip(row).zip(before) {
                    *work = apply(value, by);
                }
                chirp_z.transform(work, out, scratch);
                for (out, &by) in out.iter_mut().zip(after) {
                    *out = apply(*out, by);
                }
            },
        )
    }
}
