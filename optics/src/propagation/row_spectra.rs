//! Spectra of the response at a place in the pixel, row by row.
//!
//! The exact transfer function to a sub-sample is the Fourier transform of the response of a pixel at that place:
//!
//! ```text
//! H_o(f) = Σ g((n + o)Δ) e^{−i2πfn}   over the lags n between two pixels of the frame
//! ```
//!
//! o is the place of the sub-sample from the centre of the pixel \[px\], g the response of a
//! [pixel](super::pixel_response) of a display that shows all orders, or of the [band](super::band_samples) of one that
//! shows the first. The transform along x is here. The transform along y is done where the values are stored.

use super::band_response::bins;
use super::band_samples::BandSamples;
use super::pixel_response::PixelResponse;
use crate::display::OpticalSetup;
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::numerics::real::Number;
use crate::propagation_method::ConvolutionMethod;
use lightpath_fft::FftPlanner;
use num_complex::{Complex, Complex32, Complex64};
use rayon::prelude::*;
use std::ops::Range;

/// Whether the sub-samples of a setup have transfer functions of their own.
pub(crate) fn has_sample_transfers(setup: &OpticalSetup) -> bool {
    match setup.method() {
        ConvolutionMethod::AllOrders => true,
        ConvolutionMethod::BandResponse => bins(setup).is_some(),
        _ => false,
    }
}

/// The transfer function to the pixels' centres at all padded bins, for each column all rows. Empty if the setup is not
/// that of a [band response](ConvolutionMethod::BandResponse), or would take too many frequencies.
pub(super) fn transfer_by_column(setup: &OpticalSetup) -> Vec<Complex32> {
    let Some(samples) = BandSamples::new(setup, None, 0.0) else { return Vec::new() };
    let spectra = RowSpectra::<f32>::of_band(setup, &samples, 0.0);
    drop(samples);
    let (rows, columns) = (2 * spectra.height_px, 2 * spectra.width_px);
    let fft = FftPlanner::new().plan_fft_forward(rows);
    let mut transfer: Vec<Complex32> = zeros(rows * columns);
    let new_scratch = || (vec![Complex64::ZERO; ROWS * rows], vec![Complex64::ZERO; fft.get_inplace_scratch_len()]);
    transfer.par_chunks_mut(ROWS * rows).enumerate().for_each_init(new_scratch, |(gathered, scratch), (block, out)| {
        interrupt::check();
        let (first, gathered) = (block * ROWS, &mut gathered[..out.len()]);
        for (row, from) in spectra.values.chunks_exact(columns).enumerate() {
            for (i, from) in from[first..first + out.len() / rows].iter().enumerate() {
                gathered[i * rows + row] = widened(*from);
            }
        }
        fft.process_with_scratch(gathered, scratch);
        out.iter_mut().zip(&*gathered).for_each(|(out, exact)| *out = narrowed(*exact));
    });
    transfer
}

/// Rows that are read together: a line of the cache holds this many values.
const ROWS: usize = 8;

/// Memory of a thread that computes rows.
struct Scratch {
    gathered: Vec<Complex32>,
    sequence: Vec<Complex64>,
    buffer: Vec<Complex64>,
    fft: Vec<Complex64>,
}

/// Spectra along x of the response at one place in the pixel: for each lag along y, all padded bins.
pub(crate) struct RowSpectra<T> {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    pub(crate) values: Vec<Complex<T>>,
}

impl<T: Number> RowSpectra<T> {
    pub(crate) fn of_pixels(setup: &OpticalSetup, [offset_x, offset_y]: [f64; 2]) -> Self {
        let (response, pitch_m) = (PixelResponse::new(setup), setup.grid().pixel_pitch_m());
        let gather = |_: Range<usize>, _: &mut Vec<Complex32>| {};
        Self::new(setup, gather, |lag_y, _, Scratch { sequence, .. }| {
            let (y_m, width_px) = ((lag_y + offset_y) * pitch_m, sequence.len() / 2);
            let (from_0, from_minus_side) = sequence.split_at_mut(width_px);
            response.line(y_m, |column| (column as f64 + offset_x) * pitch_m, from_0);
            if offset_x == 0.0 {
                (1..width_px).for_each(|column| from_minus_side[width_px - column] = from_0[column]);
            } else {
                let lag_x = |column| column as f64 - width_px as f64;
                response.line(y_m, |column| (lag_x(column) + offset_x) * pitch_m, from_minus_side);
            }
        })
    }

    pub(crate) fn of_band(setup: &OpticalSetup, samples: &BandSamples, offset_x: f64) -> Self {
        let along_x = samples.along_x(offset_x);
        let gather = |rows: Range<usize>, gathered: &mut Vec<Complex32>| samples.gather(rows, gathered);
        Self::new(setup, gather, |_, row, Scratch { gathered, sequence, buffer, .. }| {
            along_x.row(row, gathered, sequence, buffer);
        })
    }

    /// `gather(rows, gathered)` reads what some rows of the padded frame need. `fill(lag_y, i, scratch)` then writes
    /// the response of the i-th of them, at a lag along y and all lags along x, into `scratch.sequence`. The lags of a
    /// whole side do not matter.
    fn new(
        setup: &OpticalSetup,
        gather: impl Fn(Range<usize>, &mut Vec<Complex32>) + Sync,
        fill: impl Fn(f64, usize, &mut Scratch) + Sync,
    ) -> Self {
        let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
        let fft = FftPlanner::new().plan_fft_forward(2 * width_px);
        let mut values: Vec<Complex<T>> = zeros(4 * height_px * width_px);
        let new_scratch = || Scratch {
            gathered: Vec::new(),
            sequence: vec![Complex64::ZERO; 2 * width_px],
            buffer: Vec::new(),
            fft: vec![Complex64::ZERO; fft.get_inplace_scratch_len()],
        };
        values.par_chunks_mut(ROWS * 2 * width_px).enumerate().for_each_init(new_scratch, |scratch, (block, rows)| {
            let first = block * ROWS;
            gather(first..first + rows.len() / (2 * width_px), &mut scratch.gathered);
            for (i, out) in rows.chunks_exact_mut(2 * width_px).enumerate() {
                interrupt::check();
                let Some(lag_y) = lag(first + i, height_px) else { continue };
                fill(lag_y, i, scratch);
                scratch.sequence[width_px] = Complex64::ZERO;
                fft.process_with_scratch(&mut scratch.sequence, &mut scratch.fft);
                out.iter_mut().zip(&scratch.sequence).for_each(|(out, exact)| *out = narrowed(*exact));
            }
        });
        Self { height_px, width_px, values }
    }
}

pub(crate) fn narrowed<T: Number>(value: Complex64) -> Complex<T> {
    Complex::new(T::of(value.re), T::of(value.im))
}

pub(crate) fn widened<T: Number>(value: Complex<T>) -> Complex64 {
    Complex64::new(value.re.wide(), value.im.wide())
}

/// The lag at an index of a sequence of `2·side_px` values that repeats; `None` for the lag of a whole side, which no
/// two pixels have.
fn lag(index: usize, side_px: usize) -> Option<f64> {
    match index.cmp(&side_px) {
        std::cmp::Ordering::Less => Some(index as f64),
        std::cmp::Ordering::Equal => None,
        std::cmp::Ordering::Greater => Some(index as f64 - 2.0 * side_px as f64),
    }
}
