//! FFT plans and tables of a convolution.

use super::axis::Axis;
use super::bins::{padded_columns, tile_columns};
use super::scratch::ScratchPool;
use super::transfer::Transfer;
use crate::numerics::batch_fft::BatchFft;
use crate::numerics::real::Number;
use lightpath_fft::FftPlanner;
use std::fmt;

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

impl<T: Number> Convolver<T> {
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

    /// Number of values in a tile of one half-transformed field.
    pub(super) fn tile_len(&self) -> usize {
        self.height_px * self.tile_columns
    }
}
