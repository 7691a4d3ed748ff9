//! Linear convolution of a field with a transfer function, in three fused passes.
//!
//! ```text
//! u = crop F⁻¹[ H · F[ pad c ] ]        pad: h×w → 2h×2w
//! ```
//!
//! The padded field is never stored. A DFT of length 2n of a signal whose second half is zero equals two DFTs of length
//! n: one of the signal (the even bins) and one of the signal times e^{−iπj/n} (the odd bins). The first half of the
//! inverse is the sum of the two inverse DFTs, the odd one times e^{+iπj/n}. So every transform has the length of the
//! unpadded side, no cropped values are computed, and sides of any length are allowed.
//!
//! A convolution takes three passes over memory. Each pass is parallel and writes contiguous blocks:
//!
//! 1. [rows](rows): compute or read a row, transform it along x, write it row-major;
//! 2. [columns](columns): transform a tile of columns along y, multiply it by H, transform it back, write it
//!    tile-major;
//! 3. rows again: gather a row, transform it back along x, use it.
//!
//! Rows and columns are computed independently, and sums are added in a fixed order, so results do not depend on the
//! number of threads.

mod columns;
mod kernels;
pub(crate) mod rows;
mod scratch;
mod tile_pass;
mod transfer;

pub(crate) use kernels::{Kernels, Window};
pub(crate) use scratch::{Scratch, ScratchPool};
pub(crate) use transfer::{Transfer, frequencies};

use crate::numerics::batch_fft::BatchFft;
use crate::numerics::real::{Number, unit_of};
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::{f64::consts::PI, fmt, sync::Arc};
use tile_pass::TilePasses;

/// Floating-point type in which convolutions are computed: f32 or f64.
#[allow(private_bounds)] // the passes over tiles are private to this crate
pub trait Real: Number + TilePasses {}

impl Real for f32 {}
impl Real for f64 {}

/// FFT plans and tables for one size and one set of sub-sample offsets.
pub(crate) struct Convolver<T> {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    /// Offsets along each axis at which the field is detected, from the pixels' centres \[px\]; empty if the
    /// sub-samples have transfer functions.
    offsets_px: Vec<f64>,
    /// Transfer functions to the sub-samples, in place of offsets; empty for offsets.
    pub(crate) to_samples: Vec<Transfer<T>>,
    /// Number of columns in a tile, which are transformed together.
    pub(crate) tile_columns: usize,
    pub(crate) down_columns: BatchFft<T>,
    pub(crate) along_x: Axis<T>,
    pub(crate) along_y: Axis<T>,
    pub(crate) scratch: ScratchPool<T>,
}

impl<T> fmt::Debug for Convolver<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Convolver({}×{} px)", self.width_px, self.height_px)
    }
}

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

impl<T: Real> Convolver<T> {
    /// Prepares convolutions of fields of `height_px` × `width_px`, detected at the given offsets \[px\] along each
    /// axis.
    pub(crate) fn new(height_px: usize, width_px: usize, offsets_px: &[f64]) -> Self {
        Self { offsets_px: offsets_px.to_vec(), ..Self::with_axes([height_px, width_px], offsets_px, offsets_px) }
    }

    /// Prepares convolutions that are detected at sub-samples with these transfer functions.
    pub(crate) fn with_transfers(height_px: usize, width_px: usize, to_samples: Vec<Transfer<T>>) -> Self {
        let lanes = vec![0.0; to_samples.len()];
        Self { to_samples, ..Self::with_axes([height_px, width_px], &[0.0], &lanes) }
    }

    fn with_axes([height_px, width_px]: [usize; 2], offsets_x_px: &[f64], offsets_y_px: &[f64]) -> Self {
        let mut planner = FftPlanner::new();
        let along_x = Axis::new(&mut planner, width_px, offsets_x_px);
        let along_y = Axis::new(&mut planner, height_px, offsets_y_px);
        let tile_columns = tile_columns::<T>(height_px);
        let scratch = ScratchPool::new(&along_x, &along_y, tile_columns);
        let down_columns = BatchFft::new(height_px, tile_columns);
        Self {
            height_px,
            width_px,
            offsets_px: Vec::new(),
            to_samples: Vec::new(),
            tile_columns,
            down_columns,
            along_x,
            along_y,
            scratch,
        }
    }

    /// Offsets along each axis at which the field is detected, from the pixels' centres \[px\].
    pub(crate) fn offsets_px(&self) -> &[f64] {
        &self.offsets_px
    }

    /// Number of half-transformed fields in the image: one for each offset along y, or for each transfer function to a
    /// sub-sample.
    pub(crate) fn lanes(&self) -> usize {
        self.along_y.offsets.len()
    }

    /// Number of sub-samples in a pixel.
    pub(crate) fn samples_per_pixel(&self) -> usize {
        self.along_x.offsets.len() * self.along_y.offsets.len()
    }

    /// Number of values in a buffer of `lanes` half-transformed fields.
    pub(crate) fn half_spectrum_len(&self, lanes: usize) -> usize {
        lanes * self.height_px * self.row_len()
    }

    /// Number of values in a half-transformed row: both halves, padded with zeros to whole tiles.
    pub(crate) fn row_len(&self) -> usize {
        padded_columns(self.width_px, self.tile_columns)
    }
}

impl<T: Real> Axis<T> {
    fn new(planner: &mut FftPlanner<T>, n: usize, offsets_px: &[f64]) -> Self {
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

/// Number of columns in a tile. A row of a tile fills whole cache lines and whole registers, and a tile's spectra fit
/// into a core's second-level cache.
pub(crate) fn tile_columns<T>(height_px: usize) -> usize {
    if height_px * size_of::<T>() <= 1280 * size_of::<f32>() { 32 } else { 16 }
}

/// Number of columns of a padded spectrum, rounded up to whole tiles.
pub(crate) fn padded_columns(width_px: usize, tile_columns: usize) -> usize {
    (2 * width_px).next_multiple_of(tile_columns)
}

/// Padded bin, 0 … 2n−1, at index `i` of the split order, which lists the even bins first and then the odd bins.
pub(crate) fn split_bin(i: usize, n: usize) -> usize {
    if i < n { 2 * i } else { 2 * (i - n) + 1 }
}

/// Frequency \[cycles/px\] of the padded bin `bin`, 0 … 2n−1.
pub(crate) fn frequency_per_px(bin: usize, n: usize) -> f64 {
    crate::numerics::grid::frequency(bin, 2 * n, 1.0)
}

#[cfg(test)]
mod check;
