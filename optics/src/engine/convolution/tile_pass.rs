//! Operations on one tile of columns: transforms along y and multiplications by transfer functions.

use super::convolver::Convolver;
use super::kernels::Kernels;
use super::scratch::TileScratch;
use super::transfer::Transfer;
use crate::numerics::batch_fft::{ComplexLanes, Factors, Planes};
use crate::numerics::real::Number;
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};

/// Operation of a pass over a tile, with its inputs and its output.
pub(super) enum Operation<'a, T> {
    /// Transforms, multiplies by H and transforms back for each offset along y.
    Propagate(&'a [Complex<T>], &'a mut [Complex<T>]),
    /// Applies the adjoint of `Operation::Propagate`.
    PropagateAdjoint(&'a [Complex<T>], &'a mut [Complex<T>]),
    /// Transforms the field of one kernel's window and writes its spectra before H is applied.
    FieldSpectra(usize, &'a [Complex<T>], &'a mut [Complex<T>]),
    /// Transforms the gradient and writes its spectra before conj(H) is applied; the scratch keeps them.
    GradientSpectra(&'a [Complex<T>], &'a mut [Complex<T>]),
    /// Transforms the gradient of one sub-sample and writes its spectra before any factor is applied.
    SampleSpectra(usize, &'a [Complex<T>], &'a mut [Complex<T>]),
    /// Applies conj(H) to the spectra that [`Operation::GradientSpectra`] left in the scratch and transforms them back.
    ReturnSpectra(&'a mut [Complex<T>]),
    /// Transforms, multiplies by H and by a weight for each kernel, and writes the sum of the spectra.
    Weigh(&'a [Complex<T>], &'a [T], &'a mut [Complex<T>]),
    /// Multiplies the spectra that `Operation::Weigh` wrote by a number for each row and transforms them back for each
    /// offset along y.
    ReturnWeighed(&'a [Complex<T>], &'a [T], &'a mut [Complex<T>]),
}

/// Passes over tiles, compiled in this crate for each precision. A generic function would be compiled again by every
/// crate that calls it, and these passes contain the butterflies of all radices for all vector instructions.
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

/// Floating-point type in which convolutions are computed: f32 or f64.
#[allow(private_bounds)] // the passes over tiles are private to this crate
pub trait Real: Number + TilePasses {}

impl Real for f32 {}
impl Real for f64 {}

/// A pass over a tile, as an operation that is compiled for the vector instructions of the machine.
pub(crate) struct TilePass<'a, T> {
    pub(super) convolver: &'a Convolver<T>,
    pub(super) kernels: &'a Kernels<T>,
    pub(super) tile: usize,
    pub(super) scratch: &'a mut TileScratch<T>,
    pub(super) operation: Operation<'a, T>,
}

impl<T: Number> WithSimd for TilePass<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { convolver, kernels, tile, scratch, operation } = self;
        let pass = Pass { simd, convolver, kernels, tile };
        match operation {
            Operation::Propagate(spectrum, out) => {
                pass.blend(spectrum, None, scratch);
                pass.return_lanes(scratch, out);
            }
            Operation::PropagateAdjoint(spectrum, out) => {
                // A single kernel is applied in the last stage of the transform.
                let factors = (kernels.transfers.len() == 1).then(|| pass.factors(0, true));
                pass.sum_lanes(spectrum, scratch, factors);
                match factors {
                    Some(_) => pass.return_tile(&mut scratch.spectra, &mut scratch.spare, (None, false), out),
                    None => pass.return_windows(scratch, out),
                }
            }
            Operation::FieldSpectra(k, spectrum, out) => {
                pass.transform_kernel(spectrum, k, &mut scratch.spectra, &mut scratch.spare, None);
                pass.write_spectra(&scratch.spectra, out);
            }
            Operation::GradientSpectra(spectrum, out) => {
                pass.sum_lanes(spectrum, scratch, None);
                pass.write_spectra(&scratch.spectra, out);
            }
            Operation::SampleSpectra(lane, spectrum, out) => {
                let TileScratch { spectra, spare, .. } = scratch;
                pass.transform(spectrum, (convolver.lanes(), lane), None, spectra, spare, None);
                pass.write_spectra(&scratch.spectra, out);
            }
            Operation::ReturnSpectra(out) => pass.return_windows(scratch, out),
            Operation::Weigh(spectrum, weights, out) => {
                pass.blend(spectrum, Some(weights), scratch);
                pass.write_spectra(&scratch.spectra, out);
            }
            Operation::ReturnWeighed(spectra, along_y, out) => {
                pass.read_spectra(spectra, along_y, &mut scratch.spectra);
                pass.return_lanes(scratch, out);
            }
        }
    }
}

struct Pass<'a, T, S> {
    simd: S,
    convolver: &'a Convolver<T>,
    kernels: &'a Kernels<T>,
    tile: usize,
}

impl<T: Number, S: Simd> Pass<'_, T, S> {
    /// Number of registers in a row of a tile.
    #[inline(always)]
    fn registers(&self) -> usize {
        self.convolver.tile_columns / T::lanes::<S>()
    }

    /// Values of H of a kernel, or their conjugates, for the even and the odd bins.
    #[inline(always)]
    fn factors(&self, kernel: usize, conjugate: bool) -> [Factors<'_, T>; 2] {
        self.kernels.transfers[kernel].halves(self.tile).map(|values| Factors { values, conjugate })
    }

    /// Values of the transfer function to a sub-sample, or their conjugates, for the even and the odd bins.
    #[inline(always)]
    fn factors_to_sample<'b>(&self, transfer: &'b Transfer<T>, conjugate: bool) -> [Factors<'b, T>; 2] {
        transfer.halves(self.tile).map(|values| Factors { values, conjugate })
    }

    /// Computes Σ over the kernels of weight · H · F[window · field] in the scratch's `spectra`.
    #[inline(always)]
    fn blend(&self, spectrum: &[Complex<T>], weights: Option<&[T]>, scratch: &mut TileScratch<T>) {
        let TileScratch { spectra, shifted, spare } = scratch;
        for kernel in 0..self.kernels.transfers.len() {
            let factors = Some(self.factors(kernel, false));
            let weight = weights.map(|weights| weights[kernel]);
            if kernel == 0 {
                self.transform_kernel(spectrum, kernel, spectra, spare, factors);
                if let Some(weight) = weight {
                    spectra.iter_mut().for_each(|half| self.scale(half, weight));
                }
                continue;
            }
            self.transform_kernel(spectrum, kernel, shifted, spare, factors);
            let weight = weight.unwrap_or(T::one());
            spectra.iter_mut().zip(&*shifted).for_each(|(sum, half)| self.add(half, weight, sum));
        }
    }

    /// Computes the spectra of the field times a kernel's window, multiplied by `factors`.
    #[inline(always)]
    fn transform_kernel(
        &self,
        spectrum: &[Complex<T>],
        kernel: usize,
        halves: &mut [Planes<T>; 2],
        spare: &mut Planes<T>,
        factors: Option<[Factors<'_, T>; 2]>,
    ) {
        let lanes = self.kernels.lanes();
        let window = self.kernels.along_y[kernel / lanes].as_deref();
        self.transform(spectrum, (lanes, kernel % lanes), window, halves, spare, factors);
    }

    /// `half` = `half` · `weight`.
    #[inline(always)]
    fn scale(&self, half: &mut Planes<T>, weight: T) {
        for values in [&mut half.re, &mut half.im] {
            values.iter_mut().for_each(|value| *value = *value * weight);
        }
    }

    /// `sum` = `sum` + `half` · `weight`.
    #[inline(always)]
    fn add(&self, half: &Planes<T>, weight: T, sum: &mut Planes<T>) {
        for (sum, half) in [(&mut sum.re, &half.re), (&mut sum.im, &half.im)] {
            sum.iter_mut().zip(half).for_each(|(sum, &value)| *sum = *sum + value * weight);
        }
    }

    /// Reads this tile of one of several half-transformed fields, multiplies it by a window along y, and writes its
    /// spectra times `factors` to `halves`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the buffers are borrowed one by one from the pass that calls this")]
    fn transform(
        &self,
        spectrum: &[Complex<T>],
        (lanes, lane): (usize, usize),
        window: Option<&[T]>,
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
            let factor = window.map(|window| ComplexLanes::splat(self.simd, Complex::new(window[y], T::zero())));
            let row = &spectrum[(y * lanes + lane) * row_len + self.tile * columns..][..columns];
            for &pair in T::interleaved::<S>(row) {
                let [re, im] = T::parts(self.simd, pair);
                let mut value = ComplexLanes::<T, S>::new(self.simd, re, im);
                if let Some(factor) = factor {
                    value = value * factor;
                }
                let turned = value * turn;
                (even_re[at], even_im[at]) = (value.re.vector, value.im.vector);
                (odd_re[at], odd_im[at]) = (turned.re.vector, turned.im.vector);
                at += 1;
            }
        }
        for (i, half) in halves.iter_mut().enumerate() {
            let factors = factors.map(|both| both[i]);
            self.convolver.down_columns.forward(self.simd, half, spare, factors);
        }
    }

    /// Computes the spectra of the adjoint of sub-sampling: the columns of each offset are multiplied by the conjugate
    /// of the offset's phase and summed.
    #[inline(always)]
    fn sum_lanes(&self, spectrum: &[Complex<T>], scratch: &mut TileScratch<T>, factors: Option<[Factors<'_, T>; 2]>) {
        if !self.convolver.to_samples.is_empty() {
            return self.sum_samples(spectrum, scratch, factors);
        }
        let TileScratch { spectra, shifted, spare } = scratch;
        let lanes = self.convolver.lanes();
        for (lane, offset) in self.convolver.along_y.offsets.iter().enumerate() {
            let Some(phases) = offset else {
                return self.transform(spectrum, (lanes, lane), None, spectra, spare, factors);
            };
            self.transform(spectrum, (lanes, lane), None, shifted, spare, None);
            let last = lane + 1 == lanes;
            let halves = spectra.iter_mut().zip(&*shifted).zip(phases.chunks_exact(self.convolver.height_px));
            for (i, ((sum, half), phases)) in halves.enumerate() {
                let factors = if last { factors.map(|both| both[i]) } else { None };
                self.add_turned_back(half, phases, lane > 0, factors, sum);
            }
        }
    }

    /// The spectra of [`Self::sum_lanes`] where each sub-sample has a transfer function.
    #[inline(always)]
    fn sum_samples(&self, spectrum: &[Complex<T>], scratch: &mut TileScratch<T>, factors: Option<[Factors<'_, T>; 2]>) {
        let TileScratch { spectra, shifted, spare } = scratch;
        let lanes = self.convolver.lanes();
        for (lane, transfer) in self.convolver.to_samples.iter().enumerate() {
            let back = Some(self.factors_to_sample(transfer, true));
            if lane == 0 {
                self.transform(spectrum, (lanes, lane), None, spectra, spare, back);
                continue;
            }
            self.transform(spectrum, (lanes, lane), None, shifted, spare, back);
            spectra.iter_mut().zip(&*shifted).for_each(|(sum, half)| self.add(half, T::one(), sum));
        }
        for (half, factors) in spectra.iter_mut().zip(factors.into_iter().flatten()) {
            factors.apply(self.simd, half);
        }
    }

    /// `sum` = `half` · conj(phase of its row), plus the previous `sum` if `add` is true; then multiplied by `factors`.
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

    /// `to` = `half` · phase of its row.
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

    /// Multiplies the spectra by conj(H) of each kernel, transforms them back, and adds up the kernels of each window
    /// along x.
    #[inline(always)]
    fn return_windows(&self, scratch: &mut TileScratch<T>, out: &mut [Complex<T>]) {
        let TileScratch { spectra, shifted, spare } = scratch;
        let lanes = self.kernels.lanes();
        for kernel in 0..self.kernels.transfers.len() {
            for ((half, turned), factors) in spectra.iter().zip(&mut *shifted).zip(self.factors(kernel, true)) {
                turned.re.copy_from_slice(&half.re);
                turned.im.copy_from_slice(&half.im);
                factors.apply(self.simd, turned);
            }
            let (window, add) = (self.kernels.along_y[kernel / lanes].as_deref(), kernel >= lanes);
            let out = &mut out[kernel % lanes * self.convolver.tile_len()..][..self.convolver.tile_len()];
            self.return_tile(shifted, spare, (window, add), out);
        }
    }

    /// Transforms the spectra back for each offset along y, or for each sub-sample that has a transfer function.
    #[inline(always)]
    fn return_lanes(&self, scratch: &mut TileScratch<T>, out: &mut [Complex<T>]) {
        let TileScratch { spectra, shifted, spare } = scratch;
        let mut outs = out.chunks_exact_mut(self.convolver.tile_len());
        for (transfer, out) in self.convolver.to_samples.iter().zip(outs.by_ref()) {
            for ((half, turned), factors) in
                spectra.iter().zip(&mut *shifted).zip(self.factors_to_sample(transfer, false))
            {
                turned.re.copy_from_slice(&half.re);
                turned.im.copy_from_slice(&half.im);
                factors.apply(self.simd, turned);
            }
            self.return_tile(shifted, spare, (None, false), out);
        }
        for (offset, out) in self.convolver.along_y.offsets.iter().zip(outs) {
            let Some(phases) = offset else {
                self.return_tile(spectra, spare, (None, false), out);
                continue;
            };
            let halves = spectra.iter().zip(&mut *shifted).zip(phases.chunks_exact(self.convolver.height_px));
            for ((half, shifted), phases) in halves {
                self.turn(half, phases, shifted);
            }
            self.return_tile(shifted, spare, (None, false), out);
        }
    }

    /// Transforms spectra back and multiplies the first half of the padded columns, even + conj(half_bin) · odd, by a
    /// window. Adds the result to `out` if `add` is true, otherwise overwrites `out`.
    #[inline(always)]
    fn return_tile(
        &self,
        halves: &mut [Planes<T>; 2],
        spare: &mut Planes<T>,
        (window, add): (Option<&[T]>, bool),
        out: &mut [Complex<T>],
    ) {
        for half in &mut *halves {
            self.convolver.down_columns.inverse(self.simd, half, spare);
        }
        let [even, odd] = &*halves;
        let (even_re, even_im) = (T::vectors::<S>(&even.re), T::vectors::<S>(&even.im));
        let (odd_re, odd_im) = (T::vectors::<S>(&odd.re), T::vectors::<S>(&odd.im));
        let rows = out.chunks_exact_mut(self.convolver.tile_columns);
        let mut at = 0;
        for (y, (row, &turn)) in rows.zip(&self.convolver.along_y.half_bin).enumerate() {
            let turn = ComplexLanes::splat(self.simd, turn).conj();
            let factor = window.map(|window| ComplexLanes::splat(self.simd, Complex::new(window[y], T::zero())));
            for pair in T::interleaved_mut::<S>(row) {
                let odd = ComplexLanes::<T, S>::new(self.simd, odd_re[at], odd_im[at]) * turn;
                let mut value = ComplexLanes::new(self.simd, even_re[at], even_im[at]) + odd;
                if let Some(factor) = factor {
                    value = value * factor;
                }
                if add {
                    let [re, im] = T::parts(self.simd, *pair);
                    value = ComplexLanes::new(self.simd, re, im) + value;
                }
                *pair = T::pair(self.simd, [value.re.vector, value.im.vector]);
                at += 1;
            }
        }
    }

    /// Reads spectra that [`Self::write_spectra`] wrote and multiplies them by a number for each row.
    #[inline(always)]
    fn read_spectra(&self, from: &[Complex<T>], along_y: &[T], spectra: &mut [Planes<T>; 2]) {
        let (registers, height_px) = (self.registers(), self.convolver.height_px);
        let halves = from.chunks_exact(self.convolver.tile_len()).zip(along_y.chunks_exact(height_px));
        for (half, (from, along_y)) in spectra.iter_mut().zip(halves) {
            let (re, im) = (T::vectors_mut::<S>(&mut half.re), T::vectors_mut::<S>(&mut half.im));
            let from = T::interleaved::<S>(from);
            for (y, &factor) in along_y.iter().enumerate() {
                let factor = ComplexLanes::splat(self.simd, Complex::new(factor, T::zero()));
                for at in y * registers..(y + 1) * registers {
                    let [from_re, from_im] = T::parts(self.simd, from[at]);
                    let value = ComplexLanes::<T, S>::new(self.simd, from_re, from_im) * factor;
                    (re[at], im[at]) = (value.re.vector, value.im.vector);
                }
            }
        }
    }

    /// Writes the spectra row by row, in split order.
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
