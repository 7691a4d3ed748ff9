//! Passes along y: a tile of columns at a time.

use super::{Axis, Convolver, TILE, Transfer, rows::add_multiply_conj, scratch::Scratch};
use crate::real::Real;
use num_complex::Complex;
use pulp::Arch;
use rayon::prelude::*;

/// Rows that are transposed together: with 8, a column's share is a cache line in f32.
const BLOCK: usize = 8;

impl<T: Real> Convolver<T> {
    /// One half-transformed field in, H applied, one field out for each offset along y.
    pub(crate) fn propagate(&self, spectrum: &[Complex<T>], transfer: &Transfer<T>, tiles: &mut [Complex<T>]) {
        let arch = Arch::new();
        let lanes = self.lanes();
        tiles.par_chunks_mut(lanes * TILE * self.height_px).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                let Scratch { columns: [spectra, shifted], fft, .. } = &mut **scratch;
                let count = out.len() / (lanes * self.height_px);
                self.transform_tile(arch, spectrum, 1, 0, tile * TILE, count, spectra, fft);
                for (k, column) in spectra.chunks_exact_mut(2 * self.height_px).take(count).enumerate() {
                    arch.dispatch(|| multiply_in_place(column, transfer.column(tile * TILE + k)));
                }
                for (offset, out) in self.along_y.offsets.iter().zip(out.chunks_exact_mut(count * self.height_px)) {
                    let columns = match offset {
                        None => &mut *spectra,
                        Some(phases) => {
                            let pairs = shifted.chunks_exact_mut(2 * self.height_px);
                            for (to, from) in pairs.zip(spectra.chunks_exact(2 * self.height_px)).take(count) {
                                arch.dispatch(|| super::rows::multiply(from, phases, to));
                            }
                            &mut *shifted
                        }
                    };
                    self.transform_tile_back(arch, columns, count, out, fft);
                }
            },
        );
    }

    /// The adjoint of [`Self::propagate`].
    pub(crate) fn propagate_adjoint(&self, spectrum: &[Complex<T>], transfer: &Transfer<T>, tiles: &mut [Complex<T>]) {
        let arch = Arch::new();
        tiles.par_chunks_mut(TILE * self.height_px).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                let Scratch { columns: [sum, lane], fft, .. } = &mut **scratch;
                let count = out.len() / self.height_px;
                self.sum_lanes(arch, spectrum, tile * TILE, count, sum, lane, fft);
                self.return_tile(arch, transfer, tile * TILE, count, sum, out, fft);
            },
        );
    }

    /// [`Self::propagate_adjoint`], and on the way the correlation of the back-propagated gradient g with the field u that
    /// went out, from which ∂L/∂H* = u*·g: `visit(column, u, g)` sees the spectra of each column, and its answers come
    /// back in the order of the columns.
    pub(crate) fn correlate<R: Send>(
        &self,
        field: &[Complex<T>],
        gradient: &[Complex<T>],
        transfer: &Transfer<T>,
        tiles: &mut [Complex<T>],
        visit: impl Fn(usize, &[Complex<T>], &[Complex<T>]) -> R + Sync,
    ) -> Vec<R> {
        let arch = Arch::new();
        let answers = tiles.par_chunks_mut(TILE * self.height_px).enumerate().map_init(
            || (self.scratch.take(), self.scratch.take()),
            |(first, second), (tile, out)| {
                let count = out.len() / self.height_px;
                let Scratch { columns: [sum, lane], fft, .. } = &mut **first;
                self.sum_lanes(arch, gradient, tile * TILE, count, sum, lane, fft);
                let field_columns = &mut second.columns[0];
                self.transform_tile(arch, field, 1, 0, tile * TILE, count, field_columns, fft);
                let columns = field_columns.chunks_exact(2 * self.height_px).zip(sum.chunks_exact(2 * self.height_px));
                let answer = |(k, (u, g))| visit(tile * TILE + k, u, g);
                let answers: Vec<R> = columns.take(count).enumerate().map(answer).collect();
                self.return_tile(arch, transfer, tile * TILE, count, sum, out, fft);
                answers
            },
        );
        answers.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Applies H* to `count` columns from `start` on and transforms them back.
    #[allow(clippy::too_many_arguments)] // a leaf: everything it touches comes from the pass above
    fn return_tile(
        &self,
        arch: Arch,
        transfer: &Transfer<T>,
        start: usize,
        count: usize,
        columns: &mut [Complex<T>],
        out: &mut [Complex<T>],
        fft: &mut [Complex<T>],
    ) {
        for (k, column) in columns.chunks_exact_mut(2 * self.height_px).take(count).enumerate() {
            arch.dispatch(|| multiply_conj_in_place(column, transfer.column(start + k)));
        }
        self.transform_tile_back(arch, columns, count, out, fft);
    }

    /// The spectra of a tile of the sub-sampled field's adjoint: each offset's columns with its phase undone, summed.
    #[allow(clippy::too_many_arguments)] // a leaf: everything it touches comes from the pass above
    fn sum_lanes(
        &self,
        arch: Arch,
        spectrum: &[Complex<T>],
        start: usize,
        count: usize,
        sum: &mut [Complex<T>],
        lane_columns: &mut [Complex<T>],
        fft: &mut [Complex<T>],
    ) {
        let lanes = self.lanes();
        for (lane, offset) in self.along_y.offsets.iter().enumerate() {
            let Some(phases) = offset else {
                self.transform_tile(arch, spectrum, lanes, lane, start, count, sum, fft);
                continue;
            };
            self.transform_tile(arch, spectrum, lanes, lane, start, count, lane_columns, fft);
            let columns = sum.chunks_exact_mut(2 * self.height_px).zip(lane_columns.chunks_exact(2 * self.height_px));
            for (to, from) in columns.take(count) {
                if lane == 0 {
                    to.fill(Complex::new(T::zero(), T::zero()));
                }
                arch.dispatch(|| add_multiply_conj(from, phases, to));
            }
        }
    }

    /// Reads `count` columns from `start` on of a row-major half spectrum and transforms them along y.
    #[allow(clippy::too_many_arguments)] // a leaf: everything it touches comes from the pass above
    fn transform_tile(
        &self,
        arch: Arch,
        spectrum: &[Complex<T>],
        lanes: usize,
        lane: usize,
        start: usize,
        count: usize,
        columns: &mut [Complex<T>],
        fft: &mut [Complex<T>],
    ) {
        let (height, width) = (self.height_px, 2 * self.width_px);
        for first in (0..height).step_by(BLOCK) {
            let rows = BLOCK.min(height - first);
            let mut block = [[Complex::new(T::zero(), T::zero()); TILE]; BLOCK];
            for (i, row) in block.iter_mut().enumerate().take(rows) {
                let at = ((first + i) * lanes + lane) * width + start;
                for (slot, &value) in row.iter_mut().zip(&spectrum[at..at + count]) {
                    *slot = value;
                }
            }
            for (k, column) in columns.chunks_exact_mut(2 * height).enumerate().take(count) {
                for (value, row) in column[first..first + rows].iter_mut().zip(&block) {
                    *value = row[k];
                }
            }
        }
        for column in columns.chunks_exact_mut(2 * height).take(count) {
            self.along_y.transform_column(arch, column, fft);
        }
    }

    /// Transforms `count` columns back and writes them as a tile; destroys `columns`.
    fn transform_tile_back(
        &self,
        arch: Arch,
        columns: &mut [Complex<T>],
        count: usize,
        out: &mut [Complex<T>],
        fft: &mut [Complex<T>],
    ) {
        for column in columns.chunks_exact_mut(2 * self.height_px).take(count) {
            self.along_y.transform_column_back(arch, column, fft);
        }
        for (first, rows) in out.chunks_mut(BLOCK * count).enumerate() {
            let mut block = [[Complex::new(T::zero(), T::zero()); TILE]; BLOCK];
            let count_rows = rows.len() / count;
            for (k, column) in columns.chunks_exact(2 * self.height_px).enumerate().take(count) {
                for (row, &value) in block.iter_mut().zip(&column[first * BLOCK..][..count_rows]) {
                    row[k] = value;
                }
            }
            for (row, block) in rows.chunks_exact_mut(count).zip(&block) {
                row.copy_from_slice(&block[..count]);
            }
        }
    }
}

impl<T: Real> Axis<T> {
    fn transform_column(&self, arch: Arch, column: &mut [Complex<T>], fft: &mut [Complex<T>]) {
        let (even, odd) = column.split_at_mut(self.n);
        arch.dispatch(|| super::rows::multiply(even, &self.half_bin, odd));
        self.forward.process_with_scratch(column, fft);
    }

    /// The result is in the first half.
    fn transform_column_back(&self, arch: Arch, column: &mut [Complex<T>], fft: &mut [Complex<T>]) {
        self.inverse.process_with_scratch(column, fft);
        let (even, odd) = column.split_at_mut(self.n);
        arch.dispatch(|| add_multiply_conj(odd, &self.half_bin, even));
    }
}

#[inline(always)]
fn multiply_in_place<T: Real>(values: &mut [Complex<T>], by: &[Complex<T>]) {
    for (value, &by) in values.iter_mut().zip(by) {
        *value = *value * by;
    }
}

#[inline(always)]
fn multiply_conj_in_place<T: Real>(values: &mut [Complex<T>], by: &[Complex<T>]) {
    for (value, &by) in values.iter_mut().zip(by) {
        *value = *value * by.conj();
    }
}
