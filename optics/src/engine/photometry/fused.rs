//! Computes the light, its comparison with a picture, and the gradient in one pass over the field.

use super::{Comparison, Quantity, Sums};
use crate::display::Detector;
use crate::engine::convolution::{Convolver, Real, Scratch};
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Number of blocks of rows whose sums are added separately. The sums of all blocks fit on the stack, and there are
/// enough blocks for the usual numbers of threads.
pub(super) const BLOCKS: usize = 64;

impl<T: Real> Convolver<T> {
    /// Compares the light in `tiles` with a picture and writes the half-transformed gradient of all offsets to
    /// `spectrum`.
    pub(crate) fn compare(
        &self,
        tiles: &[Complex<T>],
        comparison: &Comparison<'_, T>,
        spectrum: &mut [Complex<T>],
    ) -> Sums {
        let arch = Arch::new();
        let row_len = self.lanes() * self.row_len();
        let rows = self.rows_in_block();
        let mut sums = [Sums::default(); BLOCKS];
        spectrum.par_chunks_mut(rows * row_len).zip(&mut sums).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (block, (out, sum))| {
                for (y, out) in (block * rows..).zip(out.chunks_exact_mut(row_len)) {
                    let Some(columns) = comparison.region.columns(y) else {
                        out.fill(Complex::new(T::zero(), T::zero()));
                        continue;
                    };
                    self.sample_row(arch, tiles, y, scratch);
                    let Scratch { samples, reals: [light, error], .. } = &mut **scratch;
                    sum.add(&arch.dispatch(GradientRow { comparison, y, columns, samples, light, error }));
                    self.sample_row_adjoint(arch, scratch, out);
                }
            },
        );
        total(&sums)
    }

    /// Returns the sums of [`Self::compare`] without computing the gradient.
    pub(crate) fn measure(&self, tiles: &[Complex<T>], comparison: &Comparison<'_, T>) -> Sums {
        let arch = Arch::new();
        let rows = self.rows_in_block();
        let mut sums = [Sums::default(); BLOCKS];
        sums.par_iter_mut().enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (block, sum)| {
                for y in block * rows..((block + 1) * rows).min(self.height_px) {
                    let Some(columns) = comparison.region.columns(y) else { continue };
                    self.sample_row(arch, tiles, y, scratch);
                    let Scratch { samples, reals: [light, error], .. } = &mut **scratch;
                    sum.add(&arch.dispatch(GradientRow { comparison, y, columns, samples, light, error }));
                }
            },
        );
        total(&sums)
    }

    /// Number of rows in each of the [`BLOCKS`].
    pub(super) fn rows_in_block(&self) -> usize {
        self.height_px.div_ceil(BLOCKS)
    }

    /// Computes the light at each pixel, the mean over the sub-samples.
    pub(crate) fn light(&self, tiles: &[Complex<T>], light: &mut [T]) {
        let arch = Arch::new();
        light.par_chunks_mut(self.width_px).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (y, out)| {
                self.sample_row(arch, tiles, y, scratch);
                arch.dispatch(|| mean_light(&scratch.samples, self.width_px, 0..self.width_px, out));
            },
        );
    }
}

/// [`Comparison::gradient_row`] as an operation that is compiled for the vector instructions of the machine.
struct GradientRow<'a, 'b, T> {
    comparison: &'a Comparison<'b, T>,
    y: usize,
    columns: Range<usize>,
    samples: &'a mut [Complex<T>],
    light: &'a mut [T],
    error: &'a mut [T],
}

impl<T: Real> WithSimd for GradientRow<'_, '_, T> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Sums {
        self.comparison.gradient_row(self.y, self.columns, self.samples, self.light, self.error)
    }
}

/// Sum over all blocks, in their order, so that it does not depend on the number of threads.
pub(super) fn total(blocks: &[Sums; BLOCKS]) -> Sums {
    blocks.iter().fold(Sums::default(), |mut sum, row| {
        sum.add(row);
        sum
    })
}

impl<T: Real> Comparison<'_, T> {
    /// Replaces the sub-samples of row `y` by their gradient, which is zero outside `columns`, and returns the row's
    /// sums.
    #[inline(always)]
    fn gradient_row(
        &self,
        y: usize,
        columns: Range<usize>,
        samples: &mut [Complex<T>],
        light: &mut [T],
        error: &mut [T],
    ) -> Sums {
        let width_px = self.picture.width_px();
        let sample_rows = samples.len() / width_px;
        let factor = T::of(self.slope_factor() / sample_rows as f64);
        let mut sums = Sums::default();
        if self.detector != Detector::Supersampled {
            mean_light(samples, width_px, columns.clone(), light);
            sums = self.errors(y, columns.clone(), light, error);
        }
        for row in samples.chunks_exact_mut(width_px) {
            if self.detector == Detector::Supersampled {
                for (light, u) in light[columns.clone()].iter_mut().zip(&row[columns.clone()]) {
                    *light = u.norm_sqr();
                }
                sums.add(&self.errors(y, columns.clone(), light, error));
            }
            row[..columns.start].fill(Complex::new(T::zero(), T::zero()));
            row[columns.end..].fill(Complex::new(T::zero(), T::zero()));
            for (u, &error) in row[columns.clone()].iter_mut().zip(&error[columns.clone()]) {
                *u = u.scale(error * factor);
            }
        }
        if self.detector == Detector::Supersampled {
            sums.divide(sample_rows as f64);
        }
        sums
    }

    /// Ratio of the derivative of L by the light to the values that [`Self::errors`] writes.
    pub(super) fn slope_factor(&self) -> f64 {
        match self.quantity {
            Quantity::Intensity => 2.0 * self.gain / self.weight_sum,
            Quantity::Amplitude => self.gain / self.weight_sum,
        }
    }

    /// Writes w·e along the columns, or w·e/√p for amplitudes, and returns the row's sums. Replaces `light` by its
    /// square root if amplitudes are compared.
    #[inline(always)]
    pub(super) fn errors(&self, y: usize, columns: Range<usize>, light: &mut [T], error: &mut [T]) -> Sums {
        if self.quantity == Quantity::Intensity {
            return self.differences(y, columns, light, error);
        }
        for light in &mut light[columns.clone()] {
            *light = light.sqrt();
        }
        let sums = self.differences(y, columns.clone(), light, error);
        for (error, &root) in error[columns.clone()].iter_mut().zip(&light[columns]) {
            *error = if root > T::zero() { *error / root } else { T::zero() };
        }
        sums
    }

    #[inline(always)]
    fn differences(&self, y: usize, columns: Range<usize>, light: &[T], error: &mut [T]) -> Sums {
        let (gain, offset) = (T::of(self.gain), T::of(self.offset));
        let picture = &self.picture.row(y)[columns.clone()];
        let (light, error) = (&light[columns.clone()], &mut error[columns.clone()]);
        for ((error, &p), &t) in error.iter_mut().zip(light).zip(picture) {
            *error = gain * p + offset - t;
        }
        let Some(weight) = self.weight else { return sum_row(light, picture, error, |_| T::one()) };
        let weight = &weight.row(y)[columns];
        let sums = sum_row(light, picture, error, |i| weight[i]);
        for (error, &w) in error.iter_mut().zip(weight) {
            *error = *error * w;
        }
        sums
    }
}

/// Number of independent partial sums, so that the additions become vector instructions in a fixed order.
const LANES: usize = 8;

#[inline(always)]
fn sum_row<T: Real>(light: &[T], picture: &[T], error: &[T], weight: impl Fn(usize) -> T) -> Sums {
    let mut lanes = [[0.0_f64; LANES]; 9];
    let mut add = |lane: usize, i: usize| {
        let (w, p, t, e) = (weight(i).wide(), light[i].wide(), picture[i].wide(), error[i].wide());
        for (sum, value) in
            lanes.iter_mut().zip([w, w * p, w * p * p, w * t, w * t * p, w * t * t, w * e * e, w * e, w * e * p])
        {
            sum[lane] += value;
        }
    };
    let whole = light.len() / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        for lane in 0..LANES {
            add(lane, start + lane);
        }
    }
    for i in whole..light.len() {
        add(i - whole, i);
    }
    let [w, p, pp, t, tp, tt, ee, e, ep] = lanes.map(|lane| lane.iter().sum());
    Sums { w, p, pp, t, tp, tt, ee, e, ep }
}

#[inline(always)]
pub(super) fn mean_light<T: Real>(samples: &[Complex<T>], width_px: usize, columns: Range<usize>, light: &mut [T]) {
    let share = T::of(width_px as f64 / samples.len() as f64);
    let light = &mut light[columns.clone()];
    for (i, row) in samples.chunks_exact(width_px).enumerate() {
        let row = &row[columns.clone()];
        if i == 0 {
            for (light, u) in light.iter_mut().zip(row) {
                *light = u.norm_sqr() * share;
            }
        } else {
            for (light, u) in light.iter_mut().zip(row) {
                *light = *light + u.norm_sqr() * share;
            }
        }
    }
}
