//! The angular spectrum at freely chosen frequencies, and its transform onto any window.
//!
//! ```text
//! u₁(x, y) = Σ_k U₀(f_k) H(f_k) e^{i2π f_k·(x, y)} δf_x δf_y,   U₀(f) = Δ² Σ u₀(x', y') e^{−i2πf·(x', y')}
//! ```
//!
//! f_k = k·δf \[1/m\] along each axis, for whole numbers k from a first to a last one. Both sums are [chirp-z
//! transforms](super::chirp_z) along one axis, then along the other. Light that lands farther than 1/δf from its origin
//! would come back on the other side. The methods that use these sums choose δf so that no light does.

use super::chirp_z::{ChirpZ, Sign, Span};
use super::impulse_response::fading;
use super::rows::{transform_rows, transposed};
use super::shifted::{landing_m, shifted_angular_spectrum};
use crate::display::{ImageWindow, OpticalSetup};
use crate::error::{Error, Result};
use crate::numerics::Plane;
use crate::numerics::buffers::zeros;
use crate::numerics::real::Number;
use crate::propagation_method::{PropagationMethod, RefusalCode};
use lightpath_fft::FftPlanner;
use num_complex::{Complex, Complex64};
use rayon::prelude::*;

/// The frequencies f_k = k·`spacing_per_m` along one axis, k = `first` … `first` + `count` − 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrequencyAxis {
    pub(super) first: f64,
    pub(super) count: usize,
    /// Spacing δf of the frequencies \[1/m\].
    pub(super) spacing_per_m: f64,
    /// Light that lands up to this distance from the window's middle is kept whole \[m\].
    pub(super) whole_m: f64,
    /// Light that lands beyond this distance from the window's middle is left out \[m\]. Between `whole_m` and
    /// `reach_m` it fades.
    pub(super) reach_m: f64,
}

impl FrequencyAxis {
    /// The multiples of `spacing_per_m` from `low_per_m` (included) to `high_per_m` (excluded).
    pub(super) fn between(low_per_m: f64, high_per_m: f64, spacing_per_m: f64) -> Self {
        // A bound that differs from a multiple by rounding only counts as that multiple.
        const ROUNDING: f64 = 1e-9;
        let first = (low_per_m / spacing_per_m - ROUNDING).ceil();
        let end = (high_per_m / spacing_per_m - ROUNDING).ceil();
        let count = (end - first).max(0.0) as usize;
        Self { first, count, spacing_per_m, whole_m: f64::INFINITY, reach_m: f64::INFINITY }
    }

    /// The frequency \[1/m\] with index `i`, counted from 0.
    pub(super) fn at(&self, i: usize) -> f64 {
        (self.first + i as f64) * self.spacing_per_m
    }

    /// Weight, 0 to 1, of light that lands `beside_m` \[m\] beside the window's middle.
    fn weight(&self, beside_m: f64) -> f64 {
        if self.whole_m < self.reach_m {
            return fading((beside_m.abs() - self.whole_m) / (self.reach_m - self.whole_m));
        }
        if beside_m.abs() <= self.reach_m { 1.0 } else { 0.0 }
    }

    fn span(&self) -> Span {
        Span { count: self.count, origin: -self.first }
    }
}

/// Largest number of frequencies, both axes multiplied: half a gigabyte of transfer function in single precision. A
/// zoom into the image of a 4K display takes three quarters of it.
pub(super) const FREQUENCIES_MAX: usize = 1 << 26;

/// Refuses axes without frequencies or with too many frequencies.
pub(crate) fn check_frequencies(
    method: PropagationMethod,
    along_x: &FrequencyAxis,
    along_y: &FrequencyAxis,
) -> Result<()> {
    let (columns, rows) = (along_x.count, along_y.count);
    if columns == 0 || rows == 0 {
        let reason = "no light of the display lands in the window".to_owned();
        return Err(Error::Unsuitable { method, code: RefusalCode::WindowUnreachable, reason });
    }
    if columns.saturating_mul(rows) > FREQUENCIES_MAX {
        let reason = format!(
            "the window takes {columns}×{rows} frequencies, but at most {FREQUENCIES_MAX} are allowed; use a \
             smaller window"
        );
        return Err(Error::Unsuitable { method, code: RefusalCode::TooManyFrequencies, reason });
    }
    Ok(())
}

/// Planned propagation over chosen frequencies.
#[derive(Debug)]
pub(crate) struct FrequencyWindow<T> {
    /// Transforms from the display to the frequencies, along x and along y.
    to_frequencies: [ChirpZ<T>; 2],
    to_window: [ChirpZ<T>; 2],
    /// Adjoint of `to_window`, along x and along y.
    from_window: [ChirpZ<T>; 2],
    from_frequencies: [ChirpZ<T>; 2],
    /// H times Δ²·δf_x·δf_y, in order of fx, then fy: all fy of the first fx, then of the next.
    transfer: Vec<Complex<T>>,
}

impl<T: Number> FrequencyWindow<T> {
    pub(crate) fn new(setup: &OpticalSetup, window: &ImageWindow, axes: &[FrequencyAxis; 2]) -> Self {
        let (grid, mut planner) = (setup.grid(), FftPlanner::new());
        let sides = [(grid.width_px(), window.width_px()), (grid.height_px(), window.height_px())];
        let pitches = [window.pitch_x_m(), window.pitch_y_m()];
        let mut plan = |axis: usize, is_window: bool, sign: Sign, to_frequency: bool| {
            let (side, pitch_m) =
                if is_window { (sides[axis].1, pitches[axis]) } else { (sides[axis].0, grid.pixel_pitch_m()) };
            let (space, frequencies) = (Span::centred(side), axes[axis].span());
            let (from, to) = if to_frequency { (space, frequencies) } else { (frequencies, space) };
            ChirpZ::new(&mut planner, from, to, pitch_m * axes[axis].spacing_per_m, sign)
        };
        Self {
            to_frequencies: [0, 1].map(|axis| plan(axis, false, Sign::Minus, true)),
            to_window: [0, 1].map(|axis| plan(axis, true, Sign::Plus, false)),
            from_window: [0, 1].map(|axis| plan(axis, true, Sign::Minus, true)),
            from_frequencies: [0, 1].map(|axis| plan(axis, false, Sign::Plus, false)),
            transfer: sample_transfer(setup, window, axes),
        }
    }

    pub(crate) fn forward(&self, field: &Plane<Complex<T>>) -> Plane<Complex<T>> {
        self.through(field, &self.to_frequencies, |u, h| u * h, &self.to_window)
    }

    pub(crate) fn adjoint(&self, field: &Plane<Complex<T>>) -> Plane<Complex<T>> {
        self.through(field, &self.from_window, |u, h| u * h.conj(), &self.from_frequencies)
    }

    fn through(
        &self,
        field: &Plane<Complex<T>>,
        [first_x, first_y]: &[ChirpZ<T>; 2],
        apply: impl Fn(Complex<T>, Complex<T>) -> Complex<T> + Sync,
        [second_x, second_y]: &[ChirpZ<T>; 2],
    ) -> Plane<Complex<T>> {
        let rows = chirp_rows(field.values(), first_x);
        let mut columns = chirp_rows(&transposed(&rows, first_x.results()), first_y);
        columns.par_iter_mut().zip(&self.transfer).for_each(|(u, &h)| *u = apply(*u, h));
        let columns = chirp_rows(&columns, second_y);
        let values = chirp_rows(&transposed(&columns, second_y.results()), second_x);
        Plane::try_from_vec(second_y.results(), second_x.results(), values).expect("as many values as the window has")
    }
}

fn chirp_rows<T: Number>(input: &[Complex<T>], chirp_z: &ChirpZ<T>) -> Vec<Complex<T>> {
    transform_rows(
        input,
        chirp_z.samples(),
        chirp_z.results(),
        || chirp_z.scratch(),
        |row, out, scratch| chirp_z.transform(row, out, scratch),
    )
}

fn sample_transfer<T: Number>(
    setup: &OpticalSetup,
    window: &ImageWindow,
    [along_x, along_y]: &[FrequencyAxis; 2],
) -> Vec<Complex<T>> {
    let (wavelength_m, distance_m) = (setup.wavelength_m(), setup.distance_m());
    let (centre_x_m, centre_y_m) = (window.centre_x_m(), window.centre_y_m());
    let scale = setup.grid().pixel_pitch_m().powi(2) * along_x.spacing_per_m * along_y.spacing_per_m;
    let weight = |fx, fy| {
        landing_m(fx, fy, wavelength_m, distance_m)
            .map_or(0.0, |(x_m, y_m)| along_x.weight(x_m - centre_x_m) * along_y.weight(y_m - centre_y_m))
    };
    let mut transfer: Vec<Complex<T>> = zeros(along_x.count * along_y.count);
    transfer.par_chunks_exact_mut(along_y.count).enumerate().for_each(|(i, column)| {
        let fx = along_x.at(i);
        for (j, value) in column.iter_mut().enumerate() {
            let fy = along_y.at(j);
            let weight = weight(fx, fy);
            if weight > 0.0 {
                let whole: Complex64 =
                    shifted_angular_spectrum(fx, fy, wavelength_m, distance_m, centre_x_m, centre_y_m);
                let exact = whole * (weight * scale);
                *value = Complex::new(T::of(exact.re), T::of(exact.im));
            }
        }
    });
    transfer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_whole_multiples_below_upper_bound() {
        let axis = FrequencyAxis::between(-62_500.0, 62_500.0, 62_500.0 / 270.0);
        assert_eq!((axis.first, axis.count), (-270.0, 540));
        assert!((axis.at(0) + 62_500.0).abs() < 1e-9 && axis.at(270) == 0.0);
        assert_eq!(FrequencyAxis::between(1.2, 1.3, 1.0).count, 0);
        assert_eq!(FrequencyAxis::between(2.0, 1.0, 0.1).count, 0);
    }

    #[test]
    fn empty_and_oversized_axes_are_refused() {
        let axis = |count| FrequencyAxis { count, ..FrequencyAxis::between(0.0, 1.0, 1.0) };
        assert!(check_frequencies(PropagationMethod::Scaled, &axis(10), &axis(10)).is_ok());
        let none = check_frequencies(PropagationMethod::Scaled, &axis(0), &axis(10)).unwrap_err().to_string();
        assert!(none.contains("no light"), "{none}");
        let many =
            check_frequencies(PropagationMethod::Scaled, &axis(1 << 20), &axis(1 << 20)).unwrap_err().to_string();
        assert!(many.contains("1048576×1048576"), "{many}");
    }
}
