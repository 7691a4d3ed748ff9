//! Passes along y: a tile of columns at a time.

use super::{Convolver, Transfer};
use crate::batch_fft::{ComplexLanes, Factors, Planes};
use crate::real::Real;
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// A tile's spectra, and room to transform them in.
pub(crate) struct TileScratch<T> {
    /// The even and the odd bins.
    spectra: [Planes<T>; 2],
    /// Those of one offset.
    shifted: [Planes<T>; 2],
    spare: Planes<T>,
}

impl<T: Real> TileScratch<T> {
    pub(super) fn new(len: usize) -> Self {
        let planes = || Planes::zeros(len);
        Self { spectra: [planes(), planes()], shifted: [planes(), planes()], spare: planes() }
    }
}

impl<T: Real> Convolver<T> {
    /// One half-transformed field in, H applied, one field out for each offset along y.
    pub(crate) fn propagate(&self, spectrum: &[Complex<T>], transfer: &Transfer<T>, tiles: &mut [Complex<T>]) {
        tiles.par_chunks_mut(self.lanes() * self.tile_len()).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                let scratch = &mut scratch.tile;
                T::pass_over_tile(TilePass {
                    convolver: self,
                    transfer,
                    spectrum,
                    tile,
                    scratch,
                    out,
                    way: Way::There,
                });
            },
        );
    }

    /// The adjoint of [`Self::propagate`].
    pub(crate) fn propagate_adjoint(&self, spectrum: &[Complex<T>], transfer: &Transfer<T>, tiles: &mut [Complex<T>]) {
        tiles.par_chunks_mut(self.tile_len()).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (tile, out)| {
                let scratch = &mut scratch.tile;
                T::pass_over_tile(TilePass { convolver: self, transfer, spectrum, tile, scratch, out, way: Way::Back });
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
        let len = self.tile_len();
        let zeros = |len| vec![Complex::new(T::zero(), T::zero()); len];
        let answers = tiles.par_chunks_mut(len).enumerate().map_init(
            || {
                (
                    self.scratch.take(),
                    [zeros(2 * len), zeros(2 * len)],
                    [zeros(2 * self.height_px), zeros(2 * self.height_px)],
                )
            },
            |(scratch, [u, g], [u_column, g_column]), (tile, out)| {
                let scratch = &mut scratch.tile;
                let mut pass = |spectrum: &[Complex<T>], out: &mut [Complex<T>], way| {
                    T::pass_over_tile(TilePass { convolver: self, transfer, spectrum, tile, scratch, out, way });
                };
                pass(field, u, Way::SpectraThere);
                pass(gradient, g, Way::SpectraBack);
                let columns = self.tile_columns.min(2 * self.width_px - tile * self.tile_columns);
                let answers: Vec<R> = (0..columns)
                    .map(|k| {
                        read_column(u, self.tile_columns, k, u_column);
                        read_column(g, self.tile_columns, k, g_column);
                        visit(tile * self.tile_columns + k, u_column, g_column)
                    })
                    .collect();
                pass(gradient, out, Way::ReturnSpectra);
                answers
            },
        );
        answers.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Values of a tile of one half-transformed field.
    fn tile_len(&self) -> usize {
        self.height_px * self.tile_columns
    }
}

fn read_column<T: Copy>(tile: &[T], columns: usize, k: usize, column: &mut [T]) {
    for (value, row) in column.iter_mut().zip(tile.chunks_exact(columns)) {
        *value = row[k];
    }
}

/// What a pass over a tile does.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// Transform, multiply by H, transform back for each offset along y.
    There,
    /// The adjoint of it.
    Back,
    /// Stop before H and write the spectra.
    SpectraThere,
    /// The same on the way back.
    SpectraBack,
    /// Go on from the spectra that [`Way::SpectraBack`] left in the scratch.
    ReturnSpectra,
}

/// Passes over tiles as functions of one precision, which are compiled here. A generic function is compiled by every crate
/// that calls it, and these hold the butterflies of all radices for all vector instructions.
pub(crate) trait TilePasses: Sized {
    fn pass_over_tile(pass: TilePass<'_, Self>);
}

impl TilePasses for f32 {
    fn pass_over_tile(pass: TilePass<'_, Self>) {
        Arch::new().dispatch(pass);
    }
}

impl TilePasses for f64 {
    fn pass_over_tile(pass: TilePass<'_, Self>) {
        Arch::new().dispatch(pass);
    }
}

/// A pass over a tile, as an operation that is compiled for the vector instructions of the machine at hand.
pub(crate) struct TilePass<'a, T> {
    convolver: &'a Convolver<T>,
    transfer: &'a Transfer<T>,
    spectrum: &'a [Complex<T>],
    tile: usize,
    scratch: &'a mut TileScratch<T>,
    out: &'a mut [Complex<T>],
    way: Way,
}

impl<T: Real> WithSimd for TilePass<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { convolver, transfer, spectrum, tile, scratch, out, way } = self;
        let pass = Pass { simd, convolver, tile };
        let h = |conjugate| transfer.halves(tile).map(|values| Factors { values, conjugate });
        match way {
            Way::There => {
                pass.transform(spectrum, 1, 0, &mut scratch.spectra, &mut scratch.spare, Some(h(false)));
                pass.return_lanes(scratch, out);
            }
            Way::Back => {
                pass.sum_lanes(spectrum, scratch, Some(h(true)));
                pass.return_tile(&mut scratch.spectra, &mut scratch.spare, out);
            }
            Way::SpectraThere => {
                pass.transform(spectrum, 1, 0, &mut scratch.spectra, &mut scratch.spare, None);
                pass.write_spectra(&scratch.spectra, out);
            }
            Way::SpectraBack => {
                pass.sum_lanes(spectrum, scratch, None);
                pass.write_spectra(&scratch.spectra, out);
            }
            Way::ReturnSpectra => {
                for (half, factors) in scratch.spectra.iter_mut().zip(h(true)) {
                    factors.apply(simd, half);
                }
                pass.return_tile(&mut scratch.spectra, &mut scratch.spare, out);
            }
        }
    }
}

struct Pass<'a, T, S> {
    simd: S,
    convolver: &'a Convolver<T>,
    tile: usize,
}

impl<T: Real, S: Simd> Pass<'_, T, S> {
    /// Registers in a row of a tile.
    #[inline(always)]
    fn registers(&self) -> usize {
        self.convolver.tile_columns / T::lanes::<S>()
    }

    /// Reads this tile of one of `lanes` half-transformed fields and leaves its spectra, times `factors`,
    /// in `halves`.
    #[inline(always)]
    fn transform(
        &self,
        spectrum: &[Complex<T>],
        lanes: usize,
        lane: usize,
        halves: &mut [Planes<T>; 2],
        spare: &mut Planes<T>,
        factors: Option<[Factors<'_, T>; 2]>,
    ) {
        let (columns, row_len) = (self.convolver.tile_columns, self.convolver.row_len());
        let [even, odd] = &mut *halves;
        let (even_re, even_im) = (T::vectors_mut::<S>(&mut even.re), T::vectors_mut::<S>(&mut even.im));
        let (odd_re, odd_im) = (T::vectors_mut::<S>(&mut odd.re), T::vectors_mut::<S>(&mut odd.im));
        let mut at = 0;
        for (y, &turn) in self.convolver.along_y.half_bin.iter().enumerate() {
            let turn = ComplexLanes::splat(self.simd, turn);
            let row = &spectrum[(y * lanes + lane) * row_len + self.tile * columns..][..columns];
            for &pair in T::interleaved::<S>(row) {
                let [re, im] = T::parts(self.simd, pair);
                let turned = ComplexLanes::<T, S>::new(self.simd, re, im) * turn;
                (even_re[at], even_im[at]) = (re, im);
                (odd_re[at], odd_im[at]) = (turned.re.vector, turned.im.vector);
                at += 1;
            }
        }
        for (i, half) in halves.iter_mut().enumerate() {
            let factors = factors.map(|both| both[i]);
            self.convolver.down_columns.forward(self.simd, half, spare, factors);
        }
    }

    /// The spectra of the sub-sampled field's adjoint: each offset's columns with its phase undone, summed.
    #[inline(always)]
    fn sum_lanes(&self, spectrum: &[Complex<T>], scratch: &mut TileScratch<T>, factors: Option<[Factors<'_, T>; 2]>) {
        let TileScratch { spectra, shifted, spare } = scratch;
        let lanes = self.convolver.lanes();
        for (lane, offset) in self.convolver.along_y.offsets.iter().enumerate() {
            let Some(phases) = offset else {
                return self.transform(spectrum, lanes, lane, spectra, spare, factors);
            };
            self.transform(spectrum, lanes, lane, shifted, spare, None);
            let last = lane + 1 == lanes;
            let halves = spectra.iter_mut().zip(&*shifted).zip(phases.chunks_exact(self.convolver.height_px));
            for (i, ((sum, half), phases)) in halves.enumerate() {
                let factors = if last { factors.map(|both| both[i]) } else { None };
                self.add_turned_back(half, phases, lane > 0, factors, sum);
            }
        }
    }

    /// `sum` = (`sum` +) `half` · conj of its row's phase, and that times `factors`.
    #[inline(always)]
    fn add_turned_back(
        &self,
        half: &Planes<T>,
        phases: &[Complex<T>],
        add: bool,
        factors: Option<Factors<'_, T>>,
        sum: &mut Planes<T>,
    ) {
        let registers = self.registers();
        let (re, im) = (T::vectors::<S>(&half.re), T::vectors::<S>(&half.im));
        let (sum_re, sum_im) = (T::vectors_mut::<S>(&mut sum.re), T::vectors_mut::<S>(&mut sum.im));
        for (y, &phase) in phases.iter().enumerate() {
            let phase = ComplexLanes::splat(self.simd, phase).conj();
            for at in y * registers..(y + 1) * registers {
                let mut value = ComplexLanes::<T, S>::new(self.simd, re[at], im[at]) * phase;
                if add {
                    value = value + ComplexLanes::new(self.simd, sum_re[at], sum_im[at]);
                }
                if let Some(factors) = factors {
                    value = value * factors.factor(self.simd, at);
                }
                (sum_re[at], sum_im[at]) = (value.re.vector, value.im.vector);
            }
        }
    }

    /// `to` = `half` · its row's phase.
    #[inline(always)]
    fn turn(&self, half: &Planes<T>, phases: &[Complex<T>], to: &mut Planes<T>) {
        let registers = self.registers();
        let (re, im) = (T::vectors::<S>(&half.re), T::vectors::<S>(&half.im));
        let (to_re, to_im) = (T::vectors_mut::<S>(&mut to.re), T::vectors_mut::<S>(&mut to.im));
        for (y, &phase) in phases.iter().enumerate() {
            let phase = ComplexLanes::splat(self.simd, phase);
            for at in y * registers..(y + 1) * registers {
                let value = ComplexLanes::<T, S>::new(self.simd, re[at], im[at]) * phase;
                (to_re[at], to_im[at]) = (value.re.vector, value.im.vector);
            }
        }
    }

    /// Transforms the spectra back for each offset along y.
    #[inline(always)]
    fn return_lanes(&self, scratch: &mut TileScratch<T>, out: &mut [Complex<T>]) {
        let TileScratch { spectra, shifted, spare } = scratch;
        let outs = out.chunks_exact_mut(self.convolver.tile_len());
        for (offset, out) in self.convolver.along_y.offsets.iter().zip(outs) {
            let Some(phases) = offset else {
                self.return_tile(spectra, spare, out);
                continue;
            };
            let halves = spectra.iter().zip(&mut *shifted).zip(phases.chunks_exact(self.convolver.height_px));
            for ((half, shifted), phases) in halves {
                self.turn(half, phases, shifted);
            }
            self.return_tile(shifted, spare, out);
        }
    }

    /// Transforms spectra back and writes the first half of the padded columns: even + conj(half_bin) · odd.
    #[inline(always)]
    fn return_tile(&self, halves: &mut [Planes<T>; 2], spare: &mut Planes<T>, out: &mut [Complex<T>]) {
        for half in &mut *halves {
            self.convolver.down_columns.inverse(self.simd, half, spare);
        }
        let [even, odd] = &*halves;
        let (even_re, even_im) = (T::vectors::<S>(&even.re), T::vectors::<S>(&even.im));
        let (odd_re, odd_im) = (T::vectors::<S>(&odd.re), T::vectors::<S>(&odd.im));
        let rows = out.chunks_exact_mut(self.convolver.tile_columns);
        let mut at = 0;
        for (row, &turn) in rows.zip(&self.convolver.along_y.half_bin) {
            let turn = ComplexLanes::splat(self.simd, turn).conj();
            for pair in T::interleaved_mut::<S>(row) {
                let odd = ComplexLanes::<T, S>::new(self.simd, odd_re[at], odd_im[at]) * turn;
                let value = ComplexLanes::new(self.simd, even_re[at], even_im[at]) + odd;
                *pair = T::pair(self.simd, [value.re.vector, value.im.vector]);
                at += 1;
            }
        }
    }

    /// Writes the spectra row after row, in split order.
    #[inline(always)]
    fn write_spectra(&self, spectra: &[Planes<T>; 2], out: &mut [Complex<T>]) {
        for (half, out) in spectra.iter().zip(out.chunks_exact_mut(self.convolver.tile_len())) {
            let (re, im) = (T::vectors::<S>(&half.re), T::vectors::<S>(&half.im));
            for ((pair, &re), &im) in T::interleaved_mut::<S>(out).iter_mut().zip(re).zip(im) {
                *pair = T::pair(self.simd, [re, im]);
            }
        }
    }
}
