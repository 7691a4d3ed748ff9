//! Passes along x.

use super::Real;
use super::{Axis, Convolver, Window, scratch::Scratch};
use num_complex::Complex;
use pulp::Arch;
use rayon::prelude::*;

/// Half-transformed rows that are gathered together: a tile is far from the next one in memory, so its rows are read several
/// at a time.
pub(super) const ROWS: usize = 8;

impl<T: Real> Convolver<T> {
    /// Lets `fill(y, row)` write each row of a field, and for each window transforms the row times the window and stores it
    /// row-major in `spectrum`.
    ///
    /// Here and below, a closure that does arithmetic dispatches to the machine's vector instructions itself: only what is
    /// inlined into the dispatched closure is compiled for them.
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

    /// Gathers each row from `tiles` (one half-transformed field for each window), transforms it back, adds up what the
    /// windows let through, and hands it to `use_row(y, row, out)`, where `out` is what row `y` owns of `results`,
    /// `results.len() / height_px` values.
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

    /// Gathers every sub-sample of row `y` from `tiles` (all offsets along y): for each offset along y, for each along x,
    /// the row's `width_px` values.
    pub(crate) fn sample_row(&self, arch: Arch, tiles: &[Complex<T>], y: usize, scratch: &mut Scratch<T>) {
        self.sample_weighed_row(arch, tiles, y, None, scratch);
    }

    /// [`Self::sample_row`] of the field whose spectrum is multiplied by a real number for each column.
    pub(crate) fn sample_weighed_row(
        &self,
        arch: Arch,
        tiles: &[Complex<T>],
        y: usize,
        weights: Option<&[T]>,
        scratch: &mut Scratch<T>,
    ) {
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
                    // No other offset needs the half-transformed row.
                    self.along_x.transform_row_back(arch, half, out, fft);
                    continue;
                };
                arch.dispatch(|| multiply(half, phases, shifted));
                self.along_x.transform_row_back(arch, shifted, out, fft);
            }
        }
    }

    /// The adjoint of [`Self::sample_row`]: transforms the sub-samples and sums them up for each offset along y in `out`,
    /// `lanes · 2 · width_px` values.
    pub(crate) fn sample_row_adjoint(&self, arch: Arch, scratch: &mut Scratch<T>, out: &mut [Complex<T>]) {
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

    /// Copies `count` rows of all `lanes` from `tiles`.
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
    /// `row` holds n samples in its first half; both halves become the even and the odd bins.
    fn transform_row(&self, arch: Arch, row: &mut [Complex<T>], fft: &mut [Complex<T>]) {
        let (even, odd) = row.split_at_mut(self.n);
        arch.dispatch(|| multiply(even, &self.half_bin, odd));
        self.forward.process_with_scratch(row, fft);
    }

    /// The inverse without its scaling; destroys `half`.
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

/// even + conj(half_bin) · odd.
#[inline(always)]
fn join_halves<T: Real>(even: &[Complex<T>], odd: &[Complex<T>], half_bin: &[Complex<T>], out: &mut [Complex<T>]) {
    for (((out, &even), &odd), &turn) in out.iter_mut().zip(even).zip(odd).zip(half_bin) {
        *out = even + odd * turn.conj();
    }
}
