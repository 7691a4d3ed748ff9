//! Passes along x, one row at a time.

use super::axis::Axis;
use super::convolver::Convolver;
use super::kernels::Window;
use super::scratch::{ROWS, Scratch};
use super::tile_pass::Real;
use crate::interrupt;
use num_complex::Complex;
use pulp::Arch;
use rayon::prelude::*;

impl<T: Real> Convolver<T> {
    /// Calls `fill(y, row)` to write each row of a field. For each window, multiplies the row by the window, transforms
    /// it and stores it row-major in `spectrum`.
    ///
    /// In this module, closures that compute must dispatch to the machine's vector instructions themselves, because
    /// only code that is inlined into the dispatched closure is compiled for these instructions.
    pub(crate) fn forward_rows(
        &self,
        spectrum: &mut [Complex<T>],
        windows: &[Window<T>],
        fill: impl Fn(usize, &mut [Complex<T>]) + Sync,
    ) {
        let arch = Arch::new();
        spectrum.par_chunks_mut(windows.len() * self.row_len()).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (y, rows)| {
                interrupt::check();
                let Scratch { row, fft, .. } = &mut **scratch;
                let field = &mut row[..self.width_px];
                let (first, others) = rows.split_at_mut(self.row_len());
                fill(y, &mut first[..self.width_px]);
                if !others.is_empty() {
                    field.copy_from_slice(&first[..self.width_px]);
                }
                for (window, row) in windows.iter().zip(rows.chunks_exact_mut(self.row_len())) {
                    let row = &mut row[..2 * self.width_px];
                    if let Some(window) = window {
                        arch.dispatch(|| scale(field, window, &mut row[..self.width_px]));
                    }
                    self.along_x.transform_row(arch, row, fft);
                }
            },
        );
    }

    /// Gathers each row from `tiles` (one half-transformed field for each window), transforms it back, multiplies it by
    /// its window and adds up the windows. Calls `use_row(y, row, out)` with the sum, where `out` is the part of
    /// `results` for row `y`, `results.len() / height_px` values.
    pub(crate) fn inverse_rows<R: Send>(
        &self,
        tiles: &[Complex<T>],
        windows: &[Window<T>],
        results: &mut [R],
        use_row: impl Fn(usize, &[Complex<T>], &mut [R]) + Sync,
    ) {
        let arch = Arch::new();
        let per_row = results.len() / self.height_px;
        let at_once = ROWS / windows.len().next_power_of_two();
        results.par_chunks_mut(at_once * per_row).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (block, out)| {
                interrupt::check();
                let Scratch { row, rows, samples, fft, .. } = &mut **scratch;
                self.gather_rows(tiles, windows.len(), block * at_once, out.len() / per_row, rows);
                let halves = rows.chunks_exact_mut(windows.len() * self.row_len());
                for (i, (halves, out)) in halves.zip(out.chunks_mut(per_row)).enumerate() {
                    let sum = &mut samples[..self.width_px];
                    for (lane, (half, window)) in halves.chunks_exact_mut(self.row_len()).zip(windows).enumerate() {
                        let half = &mut half[..2 * self.width_px];
                        let Some(window) = window else {
                            self.along_x.transform_row_back(arch, half, sum, fft);
                            continue;
                        };
                        let part = &mut row[..self.width_px];
                        self.along_x.transform_row_back(arch, half, part, fft);
                        arch.dispatch(
                            || if lane == 0 { scale(part, window, sum) } else { add_scaled(part, window, sum) },
                        );
                    }
                    use_row(block * at_once + i, sum, out);
                }
            },
        );
    }

    /// Computes all sub-samples of row `y` from `tiles` (all offsets along y). Writes the row's `width_px` values for
    /// each offset along y and, within it, each offset along x to the scratch's `samples`.
    pub(crate) fn sample_row(&self, arch: Arch, tiles: &[Complex<T>], y: usize, scratch: &mut Scratch<T>) {
        self.sample_weighed_row(arch, tiles, y, None, scratch);
    }

    /// Computes [`Self::sample_row`] with the field's spectrum multiplied by a real number for each column.
    pub(crate) fn sample_weighed_row(
        &self,
        arch: Arch,
        tiles: &[Complex<T>],
        y: usize,
        weights: Option<&[T]>,
        scratch: &mut Scratch<T>,
    ) {
        interrupt::check();
        let Scratch { row, samples, fft, .. } = scratch;
        let (half, shifted) = row.split_at_mut(2 * self.width_px);
        let mut samples = samples.chunks_exact_mut(self.width_px);
        for lane in 0..self.lanes() {
            self.gather_row(tiles, self.lanes(), lane, y, half);
            if let Some(weights) = weights {
                half.iter_mut().zip(weights).for_each(|(value, &weight)| *value = value.scale(weight));
            }
            for offset in &self.along_x.offsets {
                let out = samples.next().expect("a slot for every sub-sample");
                let Some(phases) = offset else {
                    // The transform destroys the half-transformed row, which no other offset needs.
                    self.along_x.transform_row_back(arch, half, out, fft);
                    continue;
                };
                arch.dispatch(|| multiply(half, phases, shifted));
                self.along_x.transform_row_back(arch, shifted, out, fft);
            }
        }
    }

    /// Applies the adjoint of [`Self::sample_row`]: transforms the sub-samples and adds them up for each offset along
    /// y. Writes `2 · width_px` values for each offset along y to `out`.
    pub(crate) fn sample_row_adjoint(&self, arch: Arch, scratch: &mut Scratch<T>, out: &mut [Complex<T>]) {
        interrupt::check();
        let Scratch { row, samples, fft, .. } = scratch;
        let half = &mut row[..2 * self.width_px];
        let mut samples = samples.chunks_exact(self.width_px);
        for out in out.chunks_exact_mut(self.row_len()) {
            let out = &mut out[..2 * self.width_px];
            for (i, offset) in self.along_x.offsets.iter().enumerate() {
                let row = samples.next().expect("a slot for every sub-sample");
                let Some(phases) = offset else {
                    out[..self.width_px].copy_from_slice(row);
                    self.along_x.transform_row(arch, out, fft);
                    continue;
                };
                half[..self.width_px].copy_from_slice(row);
                self.along_x.transform_row(arch, half, fft);
                if i == 0 {
                    arch.dispatch(|| multiply_conj(half, phases, out));
                } else {
                    arch.dispatch(|| add_multiply_conj(half, phases, out));
                }
            }
        }
    }

    fn gather_row(&self, tiles: &[Complex<T>], lanes: usize, lane: usize, y: usize, half: &mut [Complex<T>]) {
        let columns = self.tile_columns;
        for (tile, out) in half.chunks_mut(columns).enumerate() {
            let start = ((tile * lanes + lane) * self.height_px + y) * columns;
            out.copy_from_slice(&tiles[start..start + out.len()]);
        }
    }

    /// Copies `count` rows from row `first` on, of all `lanes`, from `tiles` to `rows`.
    fn gather_rows(&self, tiles: &[Complex<T>], lanes: usize, first: usize, count: usize, rows: &mut [Complex<T>]) {
        let (columns, row_len) = (self.tile_columns, self.row_len());
        for (tile, parts) in tiles.chunks_exact(self.height_px * columns).enumerate() {
            let (tile, lane) = (tile / lanes, tile % lanes);
            for (i, part) in parts[first * columns..][..count * columns].chunks_exact(columns).enumerate() {
                rows[(i * lanes + lane) * row_len + tile * columns..][..columns].copy_from_slice(part);
            }
        }
    }
}

impl<T: Real> Axis<T> {
    /// Transforms a row of n samples, given in the first half of `row`, to the even bins in the first half and the odd
    /// bins in the second half.
    fn transform_row(&self, arch: Arch, row: &mut [Complex<T>], fft: &mut [Complex<T>]) {
        let (even, odd) = row.split_at_mut(self.n);
        arch.dispatch(|| multiply(even, &self.half_bin, odd));
        self.forward.process_with_scratch(row, fft);
    }

    /// Applies the inverse of `transform_row` without its scaling; destroys `half`.
    fn transform_row_back(&self, arch: Arch, half: &mut [Complex<T>], row: &mut [Complex<T>], fft: &mut [Complex<T>]) {
        self.inverse.process_with_scratch(half, fft);
        let (even, odd) = half.split_at(self.n);
        arch.dispatch(|| join_halves(even, odd, &self.half_bin, row));
    }
}

#[inline(always)]
fn scale<T: Real>(a: &[Complex<T>], b: &[T], out: &mut [Complex<T>]) {
    for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
        *out = a.scale(b);
    }
}

#[inline(always)]
fn add_scaled<T: Real>(a: &[Complex<T>], b: &[T], out: &mut [Complex<T>]) {
    for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
        *out = *out + a.scale(b);
    }
}

#[inline(always)]
fn multiply<T: Real>(a: &[Complex<T>], b: &[Complex<T>], out: &mut [Complex<T>]) {
    for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
        *out = a * b;
    }
}

#[inline(always)]
fn multiply_conj<T: Real>(a: &[Complex<T>], b: &[Complex<T>], out: &mut [Complex<T>]) {
    for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
        *out = a * b.conj();
    }
}

#[inline(always)]
fn add_multiply_conj<T: Real>(a: &[Complex<T>], b: &[Complex<T>], out: &mut [Complex<T>]) {
    for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
        *out = *out + a * b.conj();
    }
}

/// `out` = even + conj(half_bin) · odd.
#[inline(always)]
fn join_halves<T: Real>(even: &[Complex<T>], odd: &[Complex<T>], half_bin: &[Complex<T>], out: &mut [Complex<T>]) {
    for (((out, &even), &odd), &turn) in out.iter_mut().zip(even).zip(odd).zip(half_bin) {
        *out = even + odd * turn.conj();
    }
}
