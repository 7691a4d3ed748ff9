//! Sampled transfer function, in the order in which the column pass reads it.

use super::bins::{frequencies, frequency_per_px, opposite_index, padded_columns, split_bin, tile_columns};
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::numerics::real::Number;
use num_complex::{Complex, Complex64};
use rayon::prelude::*;
use std::ops::Range;

/// Transfer function H at every bin of the padded spectrum, divided by the number of bins so that the inverse transform
/// needs no scaling. The values are ordered tile by tile, with columns in split order, and within a tile row by row in
/// split order. The columns that pad the last tile are zero.
#[derive(Clone, Debug)]
pub(crate) struct Transfer<T> {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    tile_columns: usize,
    values: Vec<Complex<T>>,
}

impl<T: Number> Transfer<T> {
    /// Samples H(fx, fy), with frequencies in cycles/px.
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
        let tile_columns = tile_columns::<T>(height_px);
        let len = 2 * height_px * padded_columns(width_px, tile_columns);
        Self { height_px, width_px, tile_columns, values: zeros(len) }
    }

    /// Calls `fill(fx, fys, column)` in parallel to write each column without scaling, and then scales it. Frequencies
    /// are in cycles/px.
    pub(crate) fn fill_columns(&mut self, fill: impl Fn(f64, &[f64], &mut [Complex<T>]) + Sync) {
        let (height_px, width_px) = (self.height_px, self.width_px);
        let fys = frequencies(height_px);
        let scale = self.scale();
        self.write_columns(|i, column| {
            fill(frequency_per_px(split_bin(i, width_px), width_px), &fys, column);
            for value in column {
                *value = value.scale(scale);
            }
        });
    }

    /// Calls `write(i, column)` in parallel to write each column. The written values must already be scaled by
    /// `Self::scale`.
    pub(crate) fn write_columns(&mut self, write: impl Fn(usize, &mut [Complex<T>]) + Sync) {
        let (rows, tile_columns) = (2 * self.height_px, self.tile_columns);
        self.write_tiles(
            || vec![Complex::new(T::zero(), T::zero()); rows],
            |column, columns, tile| {
                for (k, i) in columns.enumerate() {
                    interrupt::check();
                    write(i, column);
                    for (row, &value) in tile.chunks_exact_mut(tile_columns).zip(column.iter()) {
                        row[k] = value;
                    }
                }
            },
        );
    }

    /// Calls `write(scratch, columns, tile)` in parallel to write each tile, row by row. Rows of the last tile may be
    /// longer than its range of columns; their ends stay zero. `scratch` makes the scratch memory of a thread.
    pub(crate) fn write_tiles<S>(
        &mut self,
        scratch: impl Fn() -> S + Sync + Send,
        write: impl Fn(&mut S, Range<usize>, &mut [Complex<T>]) + Sync,
    ) {
        let (rows, columns, count) = (2 * self.height_px, self.tile_columns, 2 * self.width_px);
        self.values.par_chunks_mut(rows * columns).enumerate().for_each_init(scratch, |scratch, (tile, values)| {
            let first = tile * columns;
            write(scratch, first..(first + columns).min(count), values);
        });
    }

    /// Copies column `i` to `column`.
    pub(crate) fn read_column(&self, i: usize, column: &mut [Complex<T>]) {
        let (tile, k) = (self.tile(i / self.tile_columns), i % self.tile_columns);
        for (value, row) in column.iter_mut().zip(tile.chunks_exact(self.tile_columns)) {
            *value = row[k];
        }
    }

    /// The transfer function with the opposite frequencies along each axis (x, y) where `mirrored` is true.
    pub(crate) fn mirrored(&self, mirrored: [bool; 2]) -> Self {
        let (width_px, height_px, tile_columns) = (self.width_px, self.height_px, self.tile_columns);
        let from = |i: usize, n: usize, mirrored: bool| if mirrored { opposite_index(i, n) } else { i };
        let mut mirror = Self::zeros(height_px, width_px);
        mirror.write_tiles(
            || (),
            |(), columns, tile| {
                interrupt::check();
                for (k, i) in columns.enumerate() {
                    let i = from(i, width_px, mirrored[0]);
                    let column = &self.tile(i / tile_columns)[i % tile_columns..];
                    for (row, out) in tile.chunks_exact_mut(tile_columns).enumerate() {
                        out[k] = column[from(row, height_px, mirrored[1]) * tile_columns];
                    }
                }
            },
        );
        mirror
    }

    /// Even and odd rows of a tile.
    pub(crate) fn halves(&self, tile: usize) -> [&[Complex<T>]; 2] {
        let (even, odd) = self.tile(tile).split_at(self.height_px * self.tile_columns);
        [even, odd]
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice())
    }

    fn tile(&self, tile: usize) -> &[Complex<T>] {
        let len = 2 * self.height_px * self.tile_columns;
        &self.values[tile * len..][..len]
    }

    /// Multiplies all values by [`Self::scale`], for a kernel whose values were written without it.
    pub(crate) fn scaled(self) -> Self {
        let scale = self.scale();
        self.times(scale)
    }

    /// Multiplies all values by a factor.
    pub(crate) fn times(mut self, factor: T) -> Self {
        if factor != T::one() {
            let scale = |values: &mut [Complex<T>]| values.iter_mut().for_each(|value| *value = value.scale(factor));
            self.values.par_chunks_mut(1 << 16).for_each(scale);
        }
        self
    }

    /// Factor of every value: 1 divided by the number of bins.
    pub(crate) fn scale(&self) -> T {
        T::of(1.0 / (4 * self.height_px * self.width_px) as f64)
    }
}
