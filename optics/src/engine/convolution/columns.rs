//! Passes along y, one tile of columns at a time.

use super::convolver::Convolver;
use super::kernels::Kernels;
use super::scratch::TileScratch;
use super::tile_pass::{Operation, Real, TilePass};
use crate::interrupt;
use num_complex::Complex;
use rayon::prelude::*;

impl<T: Real> Convolver<T> {
    /// Propagates the half-transformed fields of all windows in `spectrum`: applies H and writes one half-transformed
    /// field for each offset along y to `tiles`.
    pub(crate) fn propagate(&self, spectrum: &[Complex<T>], kernels: &Kernels<T>, tiles: &mut [Complex<T>]) {
        tiles.par_chunks_mut(self.lanes() * self.tile_len()).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                self.pass(kernels, tile, &mut scratch.tile, Operation::Propagate(spectrum, out));
            },
        );
    }

    /// Applies the adjoint of [`Self::propagate`].
    pub(crate) fn propagate_adjoint(&self, spectrum: &[Complex<T>], kernels: &Kernels<T>, tiles: &mut [Complex<T>]) {
        tiles.par_chunks_mut(kernels.lanes() * self.tile_len()).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                self.pass(kernels, tile, &mut scratch.tile, Operation::PropagateAdjoint(spectrum, out));
            },
        );
    }

    /// Applies [`Self::propagate_adjoint`] and visits the spectra of the outgoing field u and the back-propagated
    /// gradient g, from which ∂L/∂H* = u*·g follows. `visit(k, column, u, g)` receives the spectra of each column for
    /// each kernel k. The results are ordered by column, then by kernel.
    pub(crate) fn correlate<R: Send>(
        &self,
        field: &[Complex<T>],
        gradient: &[Complex<T>],
        kernels: &Kernels<T>,
        tiles: &mut [Complex<T>],
        visit: impl Fn(usize, usize, &[Complex<T>], &[Complex<T>]) -> R + Sync,
    ) -> Vec<R> {
        let (len, count) = (self.tile_len(), kernels.transfers.len());
        let zeros = |len| vec![Complex::new(T::zero(), T::zero()); len];
        let answers = tiles.par_chunks_mut(kernels.lanes() * len).enumerate().map_init(
            || {
                (
                    self.scratch.take(),
                    vec![zeros(2 * len); count],
                    zeros(2 * len),
                    [zeros(2 * self.height_px), zeros(2 * self.height_px)],
                )
            },
            |(scratch, u, g, [u_column, g_column]), (tile, out)| {
                let scratch = &mut scratch.tile;
                for (k, u) in u.iter_mut().enumerate() {
                    self.pass(kernels, tile, scratch, Operation::FieldSpectra(k, field, u));
                }
                self.pass(kernels, tile, scratch, Operation::GradientSpectra(gradient, g));
                let columns = self.tile_columns.min(2 * self.width_px - tile * self.tile_columns);
                let mut answers = Vec::with_capacity(columns * count);
                for column in 0..columns {
                    read_column(g, self.tile_columns, column, g_column);
                    for (k, u) in u.iter().enumerate() {
                        read_column(u, self.tile_columns, column, u_column);
                        answers.push(visit(k, tile * self.tile_columns + column, u_column, g_column));
                    }
                }
                self.pass(kernels, tile, scratch, Operation::ReturnSpectra(out));
                answers
            },
        );
        answers.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Visits the spectra of the field v in front of the sub-samples' transfer functions H_o and of each sub-sample's
    /// gradient g_o, from which ∂L/∂H_o* = v*·g_o follows. `visit(column, v, g)` receives the spectra of each column, g
    /// those of all sub-samples one after the other. The results are ordered by column.
    pub(crate) fn correlate_samples<R: Send>(
        &self,
        field: &[Complex<T>],
        gradient: &[Complex<T>],
        kernels: &Kernels<T>,
        visit: impl Fn(usize, &[Complex<T>], &[Complex<T>]) -> R + Sync,
    ) -> Vec<R> {
        let (len, lanes, rows) = (self.tile_len(), self.lanes(), 2 * self.height_px);
        let zeros = |len| vec![Complex::new(T::zero(), T::zero()); len];
        let ones = vec![T::one(); kernels.transfers.len()];
        let tiles = (2 * self.width_px).div_ceil(self.tile_columns);
        let answers = (0..tiles).into_par_iter().map_init(
            || (self.scratch.take(), zeros((1 + lanes) * 2 * len), [zeros(rows), zeros(lanes * rows)]),
            |(scratch, spectra, [v_column, g_column]), tile| {
                let (v, g) = spectra.split_at_mut(2 * len);
                self.pass(kernels, tile, &mut scratch.tile, Operation::Weigh(field, &ones, v));
                for (lane, g) in g.chunks_exact_mut(2 * len).enumerate() {
                    self.pass(kernels, tile, &mut scratch.tile, Operation::SampleSpectra(lane, gradient, g));
                }
                let columns = self.tile_columns.min(2 * self.width_px - tile * self.tile_columns);
                let answer = |column: usize| {
                    read_column(v, self.tile_columns, column, v_column);
                    for (g, out) in g.chunks_exact(2 * len).zip(g_column.chunks_exact_mut(rows)) {
                        read_column(g, self.tile_columns, column, out);
                    }
                    visit(tile * self.tile_columns + column, v_column, g_column)
                };
                (0..columns).map(answer).collect::<Vec<R>>()
            },
        );
        answers.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Σ weight·|U|² over the padded bins of a half-transformed field. `weigh(column, weights)` writes the weights of
    /// all bins of a column.
    pub(crate) fn weighted_power(&self, spectrum: &[Complex<T>], weigh: impl Fn(usize, &mut [f64]) + Sync) -> f64 {
        let kernels = &Kernels { transfers: Vec::new(), along_x: vec![None], along_y: vec![None] };
        let zeros = |len| vec![Complex::new(T::zero(), T::zero()); len];
        let tiles = (2 * self.width_px).div_ceil(self.tile_columns);
        let powers = (0..tiles).into_par_iter().map_init(
            || {
                (
                    self.scratch.take(),
                    zeros(2 * self.tile_len()),
                    zeros(2 * self.height_px),
                    vec![0.0; 2 * self.height_px],
                )
            },
            |(scratch, spectra, column, weights), tile| {
                self.pass(kernels, tile, &mut scratch.tile, Operation::FieldSpectra(0, spectrum, spectra));
                let first = tile * self.tile_columns;
                let columns = self.tile_columns.min(2 * self.width_px - first);
                let power = |k: usize| {
                    read_column(spectra, self.tile_columns, k, column);
                    weigh(first + k, weights);
                    column.iter().zip(&*weights).map(|(u, weight)| weight * u.norm_sqr().wide()).sum::<f64>()
                };
                (0..columns).map(power).sum::<f64>()
            },
        );
        powers.collect::<Vec<_>>().iter().sum()
    }

    /// Computes the spectra of the field that [`Self::propagate`] computes, with each kernel's contribution multiplied
    /// by a real weight. For each tile, `spectra` receives the even and the odd bins.
    pub(crate) fn weigh_spectra(
        &self,
        spectrum: &[Complex<T>],
        kernels: &Kernels<T>,
        weights: &[T],
        spectra: &mut [Complex<T>],
    ) {
        spectra.par_chunks_mut(2 * self.tile_len()).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                self.pass(kernels, tile, &mut scratch.tile, Operation::Weigh(spectrum, weights, out));
            },
        );
    }

    /// Multiplies [weighted spectra](Self::weigh_spectra) by a real number for each bin along y and transforms them
    /// back to one half-transformed field for each offset along y.
    pub(crate) fn return_weighed(&self, spectra: &[Complex<T>], along_y: &[T], tiles: &mut [Complex<T>]) {
        let kernels = &Kernels { transfers: Vec::new(), along_x: Vec::new(), along_y: Vec::new() };
        let lanes = self.lanes() * self.tile_len();
        let spectra = spectra.par_chunks(2 * self.tile_len());
        tiles.par_chunks_mut(lanes).zip(spectra).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, (out, spectra))| {
                self.pass(kernels, tile, &mut scratch.tile, Operation::ReturnWeighed(spectra, along_y, out));
            },
        );
    }

    fn pass(&self, kernels: &Kernels<T>, tile: usize, scratch: &mut TileScratch<T>, operation: Operation<'_, T>) {
        interrupt::check();
        T::pass_over_tile(TilePass { convolver: self, kernels, tile, scratch, operation });
    }
}

fn read_column<T: Copy>(tile: &[T], columns: usize, k: usize, column: &mut [T]) {
    for (value, row) in column.iter_mut().zip(tile.chunks_exact(columns)) {
        *value = row[k];
    }
}
