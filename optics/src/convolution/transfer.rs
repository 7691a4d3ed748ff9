//! A transfer function in the order in which the column pass reads it.

use super::{frequency_per_px, split_bin};
use crate::real::Real;
use num_complex::{Complex, Complex64};
use rayon::prelude::*;

/// H at every bin of the padded spectrum: column after column in split order, along each column in split order,
/// divided by the number of bins so that the inverse transform needs no scaling of its own.
#[derive(Clone, Debug)]
pub(crate) struct Transfer<T> {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    pub(crate) values: Vec<Complex<T>>,
}

impl<T: Real> Transfer<T> {
    /// From H(fx, fy), frequencies in cycles/px.
    pub(crate) fn sample(height_px: usize, width_px: usize, h: impl Fn(f64, f64) -> Complex64 + Sync) -> Self {
        let mut transfer = Self::zeros(height_px, width_px);
        transfer.fill_columns(|fx, fys, column| {
            for (value, &fy) in column.iter_mut().zip(fys) {
                let exact = h(fx, fy);
                *value = Complex::new(T::of(exact.re), T::of(exact.im));
            }
        });
        transfer
    }

    pub(crate) fn zeros(height_px: usize, width_px: usize) -> Self {
        let zero = Complex::new(T::zero(), T::zero());
        Self { height_px, width_px, values: vec![zero; 4 * height_px * width_px] }
    }

    /// Lets `fill(fx, fys, column)` write each column, unscaled, in parallel; frequencies in cycles/px.
    pub(crate) fn fill_columns(&mut self, fill: impl Fn(f64, &[f64], &mut [Complex<T>]) + Sync) {
        let (height_px, width_px) = (self.height_px, self.width_px);
        let fys = frequencies(height_px);
        let scale = T::of(1.0 / (4 * height_px * width_px) as f64);
        self.values.par_chunks_mut(2 * height_px).enumerate().for_each(|(i, column)| {
            fill(frequency_per_px(split_bin(i, width_px), width_px), &fys, column);
            for value in column {
                *value = value.scale(scale);
            }
        });
    }

    pub(crate) fn column(&self, i: usize) -> &[Complex<T>] {
        &self.values[i * 2 * self.height_px..][..2 * self.height_px]
    }
}

/// Frequencies [cycles/px] of the 2n padded bins in split order.
pub(crate) fn frequencies(n: usize) -> Vec<f64> {
    (0..2 * n).map(|i| frequency_per_px(split_bin(i, n), n)).collect()
}
