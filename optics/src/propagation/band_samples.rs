//! The response of the pixels' [band](super::band_response) beside the pixels' centres.
//!
//! ```text
//! h(n + o) = Δ² ∫∫ H(fx, fy) e^{i2πΔ((n_x + o_x)·fx + (n_y + o_y)·fy)} dfx dfy   over |fx|, |fy| ≤ 1/2Δ
//! ```
//!
//! n lags between two pixels of the frame, o place of a sub-sample from the centre of its pixel \[px\]. It is the same sum over
//! frequencies as at the centres. The leading term of its error along x is now
//!
//! ```text
//! error(x) = 1/(6M²) · (cos(πx) ∂H/∂ν − 2πx sin(πx) H),   x = n + o,   ν = Δ·fx = 1/2
//! ```
//!
//! A linear phase on the padded spectrum would move the samples by o as well, but from samples of the whole padded frame,
//! which beyond the image are not those of the field.

use super::band_response::{BandEnds, bins};
use crate::interrupt;
use crate::transfer_function::angular_spectrum;
use crate::{ConvolutionMethod, OpticalSetup};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Number of values of a [`BandSamples`]; 0 for another method, or if there would be too many frequencies.
pub(crate) fn band_samples(setup: &OpticalSetup) -> u64 {
    if setup.method() != ConvolutionMethod::BandResponse {
        return 0;
    }
    bins(setup).map_or(0, |[bins_x, _]| (bins_x as u64 / 2 + 2) * 2 * setup.grid().height_px() as u64)
}

/// The response at one place along y, transformed along y.
pub(super) struct BandSamples {
    height_px: usize,
    bins_x: usize,
    bins_y: usize,
    /// For each frequency from 0 to the end of the band, and for ∂H/∂ν at the end, the lags along y in the order of the padded
    /// frame. The rounding to f32 is as small as that of the transfer function that is made of them.
    along_y: Vec<Complex32>,
    fft: Arc<dyn Fft<f64>>,
}

impl BandSamples {
    /// The response at the place `offset_y` \[px\]. `None` if there would be too many frequencies.
    pub(super) fn new(setup: &OpticalSetup, offset_y: f64) -> Option<Self> {
        let [bins_x, bins_y] = bins(setup)?;
        let (height_px, half_x) = (setup.grid().height_px(), bins_x / 2);
        let pitch_m = setup.grid().pixel_pitch_m();
        let frequency = |bin: usize, bins: usize| bin as f64 / (bins as f64 * pitch_m);
        let h = |fx: f64, fy: f64| angular_spectrum(fx, fy, setup.wavelength_m(), setup.distance_m());
        let ends = BandEnds::new(setup);
        let mut planner = FftPlanner::new();
        let (fft_y, turns) = (planner.plan_fft_inverse(bins_y), turns(bins_y, offset_y));
        let lags: Vec<f64> = (0..2 * height_px).map(|row| lag(row, height_px) + offset_y).collect();
        let mut along_y = vec![Complex32::ZERO; (half_x + 2) * 2 * height_px];
        along_y.par_chunks_exact_mut(2 * height_px).enumerate().for_each_init(
            || (vec![Complex64::ZERO; bins_y], vec![Complex64::ZERO; fft_y.get_inplace_scratch_len()]),
            |(sequence, scratch), (u, out)| {
                interrupt::check();
                let fx = frequency(u, bins_x);
                let value = |v: usize| {
                    let fy = frequency(v, bins_y);
                    if u <= half_x { h(fx, fy) } else { ends.slope(fy) }
                };
                fill_even(sequence, &turns, offset_y, value);
                fft_y.process_with_scratch(sequence, scratch);
                let (end, slope) =
                    if u <= half_x { (h(fx, ends.frequency), ends.slope(fx)) } else { Default::default() };
                for (row, (out, &x)) in out.iter_mut().zip(&lags).enumerate() {
                    let exact = sequence[index(row, height_px, bins_y)] - error(x, end, slope) / (6.0 * bins_y as f64);
                    *out = Complex32::new(exact.re as f32, exact.im as f32);
                }
            },
        );
        Some(Self { height_px, bins_x, bins_y, along_y, fft: planner.plan_fft_inverse(bins_x) })
    }

    /// Rows that [`Self::row`] takes along x.
    pub(super) fn along_x(&self, offset_x: f64) -> AlongX<'_> {
        AlongX { samples: self, offset_x, turns: turns(self.bins_x, offset_x) }
    }
}

/// The response at one place in the pixel.
pub(super) struct AlongX<'a> {
    samples: &'a BandSamples,
    offset_x: f64,
    turns: Vec<Complex64>,
}

impl AlongX<'_> {
    /// Writes the response at the lag along y of a row of the padded frame, at all lags along x of its columns. `buffer` is scratch
    /// memory.
    pub(super) fn row(&self, row: usize, out: &mut [Complex64], buffer: &mut Vec<Complex64>) {
        let BandSamples { height_px, bins_x, bins_y, along_y, fft } = self.samples;
        let (half_x, width_px) = (bins_x / 2, out.len() / 2);
        let value = |u: usize| {
            let narrow = along_y[u * 2 * height_px + row];
            Complex64::new(f64::from(narrow.re), f64::from(narrow.im))
        };
        buffer.resize(bins_x + fft.get_inplace_scratch_len(), Complex64::ZERO);
        let (sequence, scratch) = buffer.split_at_mut(*bins_x);
        fill_even(sequence, &self.turns, self.offset_x, value);
        fft.process_with_scratch(sequence, scratch);
        let (end, slope) = (value(half_x), value(half_x + 1));
        let scale = 1.0 / (*bins_x as f64 * *bins_y as f64);
        for (column, out) in out.iter_mut().enumerate() {
            let error = error(lag(column, width_px) + self.offset_x, end, slope) / (6.0 * *bins_x as f64);
            *out = (sequence[index(column, width_px, *bins_x)] - error) * scale;
        }
    }
}

/// e^{i2πk·offset/bins} for k = 0 … bins/2.
fn turns(bins: usize, offset: f64) -> Vec<Complex64> {
    (0..=bins / 2).map(|k| Complex64::cis(TAU * k as f64 * offset / bins as f64)).collect()
}

/// Fills the frequencies of an even function, given from 0 to the end of the band, times the phase of the offset.
fn fill_even(sequence: &mut [Complex64], turns: &[Complex64], offset: f64, value: impl Fn(usize) -> Complex64) {
    let bins = sequence.len();
    sequence[0] = value(0);
    for k in 1..bins / 2 {
        let f = value(k);
        (sequence[k], sequence[bins - k]) = (f * turns[k], f * turns[k].conj());
    }
    // Half of the value at each end of the band.
    sequence[bins / 2] = value(bins / 2) * (PI * offset).cos();
}

/// 6M² times the error at `x`, for the values of H and ∂H/∂ν at the end of the band.
fn error(x: f64, end: Complex64, slope: Complex64) -> Complex64 {
    let (sin, cos) = (PI * x).sin_cos();
    slope * cos - end * (TAU * x * sin)
}

/// Lag of an index of the padded frame, from −side to side − 1.
fn lag(index: usize, side_px: usize) -> f64 {
    if index < side_px { index as f64 } else { index as f64 - 2.0 * side_px as f64 }
}

/// Index of a lag of the padded frame in a sequence of `bins`.
fn index(lag: usize, side_px: usize, bins: usize) -> usize {
    if lag < side_px { lag } else { bins + lag - 2 * side_px }
}
