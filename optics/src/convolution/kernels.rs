//! The transfer functions of a display: one, or a grid of them, each with its part of the SLM.
//!
//! ```text
//! u = Σ_ij F⁻¹[ H_ij · F[ ℓ_i(x) ℓ_j(y) c ] ]
//! ```
//!
//! The windows ℓ of each axis add up to one everywhere. ℓ_i is applied before a row is transformed and ℓ_j as a column is
//! read, so that a grid of n×n costs n row transforms and n² column transforms each way.

use super::Real;
use super::{Convolver, Transfer};

/// A real factor for each pixel along an axis; `None`: 1 everywhere.
pub(crate) type Window<T> = Option<Vec<T>>;

/// Transfer functions and their windows.
#[derive(Clone, Debug)]
pub(crate) struct Kernels<T> {
    /// H_ij at \[j · windows along x + i\].
    pub(crate) transfers: Vec<Transfer<T>>,
    pub(crate) along_x: Vec<Window<T>>,
    pub(crate) along_y: Vec<Window<T>>,
}

impl<T: Real> Kernels<T> {
    /// The same everywhere.
    pub(crate) fn single(transfer: Transfer<T>) -> Self {
        Self { transfers: vec![transfer], along_x: vec![None], along_y: vec![None] }
    }

    /// Those of a grid, row after row, with their windows along x and y.
    pub(crate) fn grid(transfers: Vec<Transfer<T>>, along_x: Vec<Vec<T>>, along_y: Vec<Vec<T>>) -> Self {
        let some = |windows: Vec<Vec<T>>| windows.into_iter().map(Some).collect();
        Self { transfers, along_x: some(along_x), along_y: some(along_y) }
    }

    /// The transfer function where there is one alone.
    pub(crate) fn only_mut(&mut self) -> &mut Transfer<T> {
        &mut self.transfers[0]
    }

    /// Half-transformed fields on the SLM's side: one for each window along x.
    pub(crate) fn lanes(&self) -> usize {
        self.along_x.len()
    }

    /// Values of the half-transformed fields on the SLM's side.
    pub(crate) fn half_spectrum_len(&self, convolver: &Convolver<T>) -> usize {
        convolver.half_spectrum_len(self.lanes())
    }

    pub(crate) fn bytes(&self) -> usize {
        self.transfers.iter().map(Transfer::bytes).sum()
    }
}
