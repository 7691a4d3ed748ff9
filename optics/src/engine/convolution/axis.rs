//! FFT plans and tables along one axis.

use super::bins::{frequency_per_px, split_bin};
use crate::numerics::real::{Number, unit_of};
use lightpath_fft::{Fft, FftPlanner};
use num_complex::Complex;
use std::{f64::consts::PI, sync::Arc};

/// FFT plans and tables along one axis of n samples.
pub(crate) struct Axis<T> {
    pub(crate) n: usize,
    pub(crate) forward: Arc<dyn Fft<T>>,
    pub(crate) inverse: Arc<dyn Fft<T>>,
    /// Factors e^{−iπj/n}. A transform of length n of the signal times these factors gives the odd bins of the
    /// transform of length 2n.
    pub(crate) half_bin: Vec<Complex<T>>,
    /// Factors e^{i2πf·offset} for each offset, at all 2n bins in split order; `None` for an offset of 0.
    pub(crate) offsets: Vec<Option<Vec<Complex<T>>>>,
}

impl<T: Number> Axis<T> {
    pub(super) fn new(planner: &mut FftPlanner<T>, n: usize, offsets_px: &[f64]) -> Self {
        let half_bin = (0..n).map(|j| unit_of(-PI * j as f64 / n as f64)).collect();
        let offsets = offsets_px
            .iter()
            .map(|&offset_px| {
                (offset_px != 0.0).then(|| {
                    (0..2 * n).map(|i| unit_of(2.0 * PI * frequency_per_px(split_bin(i, n), n) * offset_px)).collect()
                })
            })
            .collect();
        Self { n, forward: planner.plan_fft_forward(n), inverse: planner.plan_fft_inverse(n), half_bin, offsets }
    }
}
