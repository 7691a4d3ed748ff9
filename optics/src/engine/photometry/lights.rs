//! Comparison of light with a picture in two passes, with the light kept between them.
//!
//! The first pass samples the field and adds up its light over frames. The second pass multiplies each sample by the
//! slope ∂L/∂p of the loss and transforms the products along x, the first step of the propagation back. Between the
//! passes all of the light is available.
//!
//! Light is kept as *light planes* in the order `[y][plane][x]`: one plane for the detectors `Point` and `Pixel`, and
//! one for each sub-sample with `Supersampled`.

use super::fused::{BLOCKS, mean_light, total};
use super::{Comparison, Sums};
use crate::display::Detector;
use crate::engine::convolution::{Convolver, Real, Scratch};
use crate::interrupt;
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

impl Detector {
    /// Number of light planes that a comparison uses.
    pub(crate) fn light_planes(self) -> usize {
        match self {
            Self::Point | Self::Pixel => 1,
            Self::Supersampled => self.samples(),
        }
    }
}

impl<T: Real> Convolver<T> {
    /// Samples the field in `tiles` and adds its light times `share` to `lights`. For the `first` of several fields the
    /// light is written instead of added. Copies the samples to `stored` if it is given; it has the length of a
    /// half-transformed field.
    pub(crate) fn add_light(
        &self,
        tiles: &[Complex<T>],
        share: f64,
        first: bool,
        stored: Option<&mut [Complex<T>]>,
        lights: &mut [T],
    ) {
        let row_len = lights.len() / self.height_px;
        let light_rows = lights.par_chunks_mut(row_len).enumerate();
        let light_of = |y: usize, light: &mut [T], scratch: &mut Scratch<T>| {
            let arch = Arch::new();
            self.sample_row(arch, tiles, y, scratch);
            let Scratch { samples, reals: [row, _], .. } = scratch;
            arch.dispatch(LightRow { samples, share: T::of(share), first, row, light });
        };
        match stored {
            None => light_rows.for_each_init(|| self.scratch.take(), |scratch, (y, light)| light_of(y, light, scratch)),
            Some(stored) => {
                let stored_rows = stored.par_chunks_mut(self.lanes() * self.row_len());
                light_rows.zip(stored_rows).for_each_init(
                    || self.scratch.take(),
                    |scratch, ((y, light), stored)| {
                        light_of(y, light, scratch);
                        // With two offsets along each axis, the four sub-samples fill the row's four half spectra.
                        stored[..scratch.samples.len()].copy_from_slice(&scratch.samples);
                    },
                );
            }
        }
    }

    /// Multiplies the samples that [`Self::add_light`] kept by `factor` and the slope of their light plane, and
    /// transforms them along x. The half-transformed gradient replaces the samples.
    pub(crate) fn weigh_stored_samples(&self, stored: &mut [Complex<T>], slopes: &[T], factor: f64) {
        let arch = Arch::new();
        let slope_len = slopes.len() / self.height_px;
        stored.par_chunks_mut(self.lanes() * self.row_len()).zip(slopes.par_chunks(slope_len)).for_each_init(
            || self.scratch.take(),
            |scratch, (stored, slopes)| {
                let len = scratch.samples.len();
                scratch.samples.copy_from_slice(&stored[..len]);
                arch.dispatch(WeighRow { samples: &mut scratch.samples, slopes, factor: T::of(factor) });
                self.sample_row_adjoint(arch, scratch, stored);
                // The kept samples also overwrote the padding of the rows, which must be zero.
                let zero = Complex::new(T::zero(), T::zero());
                stored.chunks_exact_mut(self.row_len()).for_each(|row| row[2 * self.width_px..].fill(zero));
            },
        );
    }

    /// Computes the half-transformed gradient like [`Self::weigh_stored_samples`], but samples the field in `tiles`
    /// again.
    pub(crate) fn weigh_sampled_tiles(
        &self,
        tiles: &[Complex<T>],
        slopes: &[T],
        factor: f64,
        spectrum: &mut [Complex<T>],
    ) {
        let arch = Arch::new();
        let slope_len = slopes.len() / self.height_px;
        let rows = spectrum.par_chunks_mut(self.lanes() * self.row_len()).zip(slopes.par_chunks(slope_len));
        rows.enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (y, (out, slopes))| {
                self.sample_row(arch, tiles, y, scratch);
                arch.dispatch(WeighRow { samples: &mut scratch.samples, slopes, factor: T::of(factor) });
                self.sample_row_adjoint(arch, scratch, out);
            },
        );
    }
}

impl<T: Real> Convolver<T> {
    /// Returns the mean sums of the light planes and writes ∂L/∂p at the comparison's gain to `slopes`. With several
    /// light planes L is the sum of their losses, so the slopes are those of the mean loss times the number of planes.
    pub(crate) fn slopes(&self, comparison: &Comparison<'_, T>, lights: &[T], slopes: &mut [T]) -> Sums {
        let arch = Arch::new();
        let planes = comparison.detector.light_planes();
        let (rows, row_len) = (self.rows_in_block(), planes * self.width_px);
        let mut sums = [Sums::default(); BLOCKS];
        let blocks = (lights.par_chunks(rows * row_len), slopes.par_chunks_mut(rows * row_len), &mut sums[..]);
        blocks.into_par_iter().enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (block, (lights, slopes, sum))| {
                let lines = lights.chunks_exact(row_len).zip(slopes.chunks_exact_mut(row_len));
                for (y, (light, slopes)) in (block * rows..).zip(lines) {
                    interrupt::check();
                    let row = &mut scratch.reals[0];
                    sum.add(&arch.dispatch(SlopeRow { comparison, y, light, row, slopes }));
                }
            },
        );
        mean_over(planes, &sums)
    }

    /// Returns the sums of [`Self::slopes`] without keeping the slopes.
    pub(crate) fn measure_lights(&self, comparison: &Comparison<'_, T>, lights: &[T]) -> Sums {
        let arch = Arch::new();
        let planes = comparison.detector.light_planes();
        let (rows, row_len) = (self.rows_in_block(), planes * self.width_px);
        let mut sums = [Sums::default(); BLOCKS];
        lights.par_chunks(rows * row_len).zip(&mut sums).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (block, (lights, sum))| {
                for (y, light) in (block * rows..).zip(lights.chunks_exact(row_len)) {
                    interrupt::check();
                    let [row, slopes] = &mut scratch.reals;
                    let slopes = &mut slopes[..row_len];
                    sum.add(&arch.dispatch(SlopeRow { comparison, y, light, row, slopes }));
                }
            },
        );
        mean_over(planes, &sums)
    }
}

fn mean_over(planes: usize, sums: &[Sums; BLOCKS]) -> Sums {
    let mut sums = total(sums);
    sums.divide(planes as f64);
    sums
}

/// Adds the light of one row, as an operation that is compiled for the machine's vector instructions.
struct LightRow<'a, T> {
    samples: &'a [Complex<T>],
    share: T,
    first: bool,
    row: &'a mut [T],
    light: &'a mut [T],
}

impl<T: Real> WithSimd for LightRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { samples, share, first, row, light } = self;
        let width_px = row.len();
        let per_plane = samples.len() / light.len();
        for (samples, light) in samples.chunks_exact(per_plane * width_px).zip(light.chunks_exact_mut(width_px)) {
            mean_light(samples, width_px, 0..width_px, row);
            if first {
                light.iter_mut().zip(&*row).for_each(|(light, &p)| *light = p * share);
            } else {
                light.iter_mut().zip(&*row).for_each(|(light, &p)| *light = *light + p * share);
            }
        }
    }
}

/// Multiplies the samples of one row by their slopes, as an operation that is compiled for the machine's vector
/// instructions.
struct WeighRow<'a, T> {
    samples: &'a mut [Complex<T>],
    slopes: &'a [T],
    factor: T,
}

impl<T: Real> WithSimd for WeighRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { samples, slopes, factor } = self;
        let repeats = samples.len() / slopes.len();
        for (samples, slopes) in chunks(samples, slopes, repeats) {
            for (u, &slope) in samples.iter_mut().zip(slopes) {
                *u = u.scale(slope * factor);
            }
        }
    }
}

/// Pairs the rows of samples with their slopes. With one light plane all rows of samples share one row of slopes;
/// otherwise each has its own.
#[inline(always)]
fn chunks<'a, T: Real>(
    samples: &'a mut [Complex<T>],
    slopes: &'a [T],
    repeats: usize,
) -> impl Iterator<Item = (&'a mut [Complex<T>], &'a [T])> {
    let len = slopes.len();
    // With one slope per sample the whole row is one chunk.
    samples.chunks_exact_mut(len).zip(std::iter::repeat_n(slopes, repeats))
}

/// Computes sums and slopes of one row, as an operation that is compiled for the machine's vector instructions.
struct SlopeRow<'a, 'b, T> {
    comparison: &'a Comparison<'b, T>,
    y: usize,
    light: &'a [T],
    row: &'a mut [T],
    slopes: &'a mut [T],
}

impl<T: Real> WithSimd for SlopeRow<'_, '_, T> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Sums {
        let Self { comparison, y, light, row, slopes } = self;
        let Some(columns) = comparison.region.columns(y) else {
            slopes.fill(T::zero());
            return Sums::default();
        };
        let (width_px, factor) = (row.len(), T::of(comparison.slope_factor()));
        let mut sums = Sums::default();
        for (light, slopes) in light.chunks_exact(width_px).zip(slopes.chunks_exact_mut(width_px)) {
            row.copy_from_slice(light);
            sums.add(&comparison.errors(y, columns.clone(), row, slopes));
            slopes[..columns.start].fill(T::zero());
            slopes[columns.end..].fill(T::zero());
            slopes[columns.clone()].iter_mut().for_each(|slope| *slope = *slope * factor);
        }
        sums
    }
}
