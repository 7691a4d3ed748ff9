//! Evaluation of H = H_ideal · exp(α + iψ) for changing α and ψ, and the gradient of a loss with respect to them.

use crate::display::OpticalSetup;
use crate::engine::Real;
use crate::engine::convolution::{Transfer, frequencies};
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::{ChebyshevBasis, polynomials};
use crate::numerics::real::unit;
use num_complex::{Complex, Complex64};
use pulp::{Arch, Simd, WithSimd};

use super::columns::project;

/// The ideal transfer functions of the planes and the polynomials along y, sampled once and then reused.
#[derive(Debug)]
pub(super) struct SmoothTransfer<T> {
    basis: ChebyshevBasis,
    ideal: Vec<Transfer<T>>,
    /// fx of each column, scaled to [−1, 1].
    pub(super) columns: Vec<f64>,
    /// fy of each bin, scaled to [−1, 1].
    pub(super) rows: Vec<f64>,
    /// T_j at the fy of each bin.
    polynomials: Vec<Vec<T>>,
}

/// Σ along a column of u · g* · H · T_j(fy), for each j.
pub(super) type ColumnSums = [Complex64; ChebyshevBasis::ORDER_MAX + 1];

impl<T: Real> SmoothTransfer<T> {
    /// Samples the ideal transfer functions of planes that share a grid.
    pub(super) fn new(setups: &[OpticalSetup], order: usize) -> Self {
        let grid = setups[0].grid();
        let pitch_m = grid.pixel_pitch_m();
        let ideal = |setup: &OpticalSetup| {
            let sampled = setup.sampled_kernel();
            Transfer::sample(grid.height_px(), grid.width_px(), |fx, fy| sampled.at(fx / pitch_m, fy / pitch_m))
        };
        let scaled = |side_px: usize| frequencies(side_px).iter().map(|f| 2.0 * f).collect::<Vec<f64>>();
        let rows = scaled(grid.height_px());
        Self {
            basis: ChebyshevBasis::new(order),
            ideal: setups.iter().map(ideal).collect(),
            columns: scaled(grid.width_px()),
            polynomials: tabulate(order, &rows),
            rows,
        }
    }

    /// Changes the order of α and ψ.
    pub(super) fn change_order(&mut self, order: usize) {
        self.basis = ChebyshevBasis::new(order);
        self.polynomials = tabulate(order, &self.rows);
    }

    /// T_0 … T_order at the fx of each column.
    pub(super) fn polynomials_x(&self) -> Vec<Vec<T>> {
        tabulate(self.basis.order(), &self.columns)
    }

    /// T_0 … T_order at the fy of each bin.
    pub(super) fn polynomials_y(&self) -> &[Vec<T>] {
        &self.polynomials
    }

    /// T_j at the fy of each bin.
    pub(super) fn polynomial_y(&self, j: usize) -> &[T] {
        &self.polynomials[j]
    }

    /// Writes H of a plane with the given α and ψ.
    pub(super) fn apply(&self, plane: usize, errors: &SmoothField, transfer: &mut Transfer<T>) {
        let arch = Arch::new();
        transfer.write_columns(|i, column| {
            let mut ideal = column.to_vec();
            self.ideal[plane].read_column(i, &mut ideal);
            let (mut alpha, mut psi) = (vec![T::zero(); ideal.len()], vec![T::zero(); ideal.len()]);
            let log_amplitude = self.basis.along_y(&errors.log_amplitude, self.columns[i]);
            let phase = self.basis.along_y(&errors.phase, self.columns[i]);
            arch.dispatch(|| self.sum_series(&log_amplitude, &mut alpha));
            arch.dispatch(|| self.sum_series(&phase, &mut psi));
            arch.dispatch(Exponential { ideal: &ideal, alpha: &alpha, psi: &psi, column });
        });
    }

    /// Contribution of one column of the spectra to the gradient.
    pub(super) fn column_sums(&self, h: &[Complex<T>], u: &[Complex<T>], g: &[Complex<T>]) -> ColumnSums {
        Arch::new().dispatch(SumColumn { smooth: self, h, u, g })
    }

    /// ∂L/∂α and ∂L/∂ψ of each coefficient: 2 Re Σ T and −2 Im Σ T over all columns.
    pub(super) fn gradient<'a>(&self, columns: impl Iterator<Item = &'a ColumnSums>) -> (Vec<f64>, Vec<f64>) {
        let mut totals = vec![[Complex64::ZERO; ChebyshevBasis::ORDER_MAX + 1]; self.basis.order() + 1];
        for (sums, &fx) in columns.zip(&self.columns) {
            for (total, t) in totals.iter_mut().zip(polynomials(self.basis.order(), fx)) {
                for (total, sum) in total.iter_mut().zip(sums) {
                    *total += sum * t;
                }
            }
        }
        self.basis.degrees().map(|(i, j)| (2.0 * totals[i][j].re, -2.0 * totals[i][j].im)).unzip()
    }

    #[inline(always)]
    fn sum_series(&self, coefficients: &[f64], out: &mut [T]) {
        out.fill(T::of(coefficients[0]));
        for (&c, polynomial) in coefficients.iter().zip(&self.polynomials).skip(1) {
            let c = T::of(c);
            for (out, &t) in out.iter_mut().zip(polynomial) {
                *out = *out + c * t;
            }
        }
    }
}

/// T_0 … T_order at each of the points.
fn tabulate<T: Real>(order: usize, points: &[f64]) -> Vec<Vec<T>> {
    let at: Vec<Vec<f64>> = points.iter().map(|&x| polynomials(order, x)).collect();
    (0..=order).map(|j| at.iter().map(|t| T::of(t[j])).collect()).collect()
}

/// [`SmoothTransfer::column_sums`] as an operation that is compiled for the vector instructions of the current machine.
struct SumColumn<'a, T> {
    smooth: &'a SmoothTransfer<T>,
    h: &'a [Complex<T>],
    u: &'a [Complex<T>],
    g: &'a [Complex<T>],
}

impl<T: Real> WithSimd for SumColumn<'_, T> {
    type Output = ColumnSums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> ColumnSums {
        let Self { smooth, h, u, g } = self;
        let mut sums = [Complex64::ZERO; ChebyshevBasis::ORDER_MAX + 1];
        project(|k| u[k] * g[k].conj() * h[k], &smooth.polynomials, &mut sums);
        sums
    }
}

/// ideal · exp(α + iψ) as an operation that is compiled for the vector instructions of the current machine.
struct Exponential<'a, T> {
    ideal: &'a [Complex<T>],
    alpha: &'a [T],
    psi: &'a [T],
    column: &'a mut [Complex<T>],
}

impl<T: Real> WithSimd for Exponential<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (((h, &ideal), &alpha), &psi) in self.column.iter_mut().zip(self.ideal).zip(self.alpha).zip(self.psi) {
            *h = ideal * unit(psi).scale(alpha.exponential());
        }
    }
}
