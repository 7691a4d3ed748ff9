//! Transfer functions of a display: a single one, or a grid of them, each for one part of the SLM.
//!
//! ```text
//! u = Σ_ij F⁻¹[ H_ij · F[ ℓ_i(x) ℓ_j(y) c ] ]
//! ```
//!
//! The windows ℓ of each axis add up to 1 everywhere. ℓ_i is applied before a row is transformed and ℓ_j when a column
//! is read. A grid of n×n therefore costs n row transforms and n² column transforms in each direction.

use super::convolver::Convolver;
use super::transfer::Transfer;
use crate::numerics::real::Number;

/// Window along an axis: a real factor for each pixel; `None`: 1 everywhere.
pub(crate) type Window<T> = Option<Vec<T>>;

/// Transfer functions of a display, with their windows.
#[derive(Clone, Debug)]
pub(crate) struct Kernels<T> {
    /// Transfer functions H_ij at index j · (number of windows along x) + i.
    pub(crate) transfers: Vec<Transfer<T>>,
    pub(crate) along_x: Vec<Window<T>>,
    pub(crate) along_y: Vec<Window<T>>,
}

impl<T: Number> Kernels<T> {
    /// A single transfer function for the whole SLM.
    pub(crate) fn single(transfer: Transfer<T>) -> Self {
        Self { transfers: vec![transfer], along_x: vec![None], along_y: vec![None] }
    }

    /// A grid of transfer functions, row by row, with their windows along x and y.
    pub(crate) fn grid(transfers: Vec<Transfer<T>>, along_x: Vec<Vec<T>>, along_y: Vec<Vec<T>>) -> Self {
        let some = |windows: Vec<Vec<T>>| windows.into_iter().map(Some).collect();
        Self { transfers, along_x: some(along_x), along_y: some(along_y) }
    }

    /// The first transfer function; a single kernel has no other.
    pub(crate) fn first_mut(&mut self) -> &mut Transfer<T> {
        &mut self.transfers[0]
    }

    /// Number of half-transformed fields on the SLM's side: one for each window along x.
    pub(crate) fn lanes(&self) -> usize {
        self.along_x.len()
    }

    /// Number of values in the half-transformed fields on the SLM's side.
    pub(crate) fn half_spectrum_len(&self, convolver: &Convolver<T>) -> usize {
        convolver.half_spectrum_len(self.lanes())
    }

    pub(crate) fn bytes(&self) -> usize {
        self.transfers.iter().map(Transfer::bytes).sum()
    }
}
