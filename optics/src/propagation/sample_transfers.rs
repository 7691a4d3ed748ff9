//! Transfer functions from the display to each sub-sample of the image.
//!
//! The exact transfer function to a sub-sample is the Fourier transform of the response of a pixel at that place:
//!
//! ```text
//! H_o(f) = Σ g((n + o)Δ) e^{−i2πfn}   over the lags n between two pixels of the frame
//! ```
//!
//! o is the place of the sub-sample from the centre of the pixel \[px\], g the response of a
//! [pixel](super::pixel_response) of a display that shows all orders, or of the [band](super::band_samples) of one that
//! shows the first. g is even along both axes, so the sub-samples (±o_x, ±o_y) share its values.

use super::band_response::bins;
use super::band_samples::{BandSamples, is_even};
use super::pixel_response::PixelResponse;
use crate::display::OpticalSetup;
use crate::display::parts::ghost::TransferErrors;
use crate::engine::Real;
use crate::engine::convolution::{Transfer, split_bin};
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::propagation_method::ConvolutionMethod;
use num_complex::{Complex, Complex32, Complex64};
use rayon::prelude::*;
use rustfft::FftPlanner;
use std::ops::Range;

/// Whether [`for_each_sample_transfer`] has transfer functions for a setup.
pub(crate) fn has_sample_transfers(setup: &OpticalSetup) -> bool {
    match setup.method() {
        ConvolutionMethod::AllOrders => true,
        ConvolutionMethod::BandResponse => bins(setup).is_some(),
        _ => false,
    }
}

/// Transfer functions to the sub-samples at these places (x, y) from the centre of the pixel \[px\].
pub(crate) fn sample_transfers<T: Real>(setup: &OpticalSetup, places_px: &[[f64; 2]]) -> Vec<Transfer<T>> {
    let mut transfers: Vec<Option<Transfer<T>>> = places_px.iter().map(|_| None).collect();
    for_each_sample_transfer(setup, None, places_px, |i, transfer| transfers[i] = Some(transfer));
    transfers.into_iter().flatten().collect()
}

/// Calls `use_transfer(i, transfer)` with the transfer function to each of the places, in an order in which places
/// share what they can. On a display that shows the first order, it is that behind smooth `errors` of its kernel. Only
/// one transfer function exists at a time. None if the setup [has none](has_sample_transfers).
pub(crate) fn for_each_sample_transfer<T: Real>(
    setup: &OpticalSetup,
    errors: Option<&TransferErrors>,
    places_px: &[[f64; 2]],
    mut use_transfer: impl FnMut(usize, Transfer<T>),
) {
    // The places of an even response are mirror images.
    let is_even = is_even(setup, errors.is_some());
    let shared = |place: [f64; 2]| if is_even { place.map(f64::abs) } else { place };
    let mut waiting: Vec<usize> = (0..places_px.len()).collect();
    let mut samples: Option<(f64, BandSamples)> = None;
    while let Some(&first) = waiting.first() {
        let wanted = shared(places_px[first]);
        let spectra = match setup.method() {
            ConvolutionMethod::AllOrders => RowSpectra::<T>::of_pixels(setup, wanted),
            ConvolutionMethod::BandResponse => {
                if samples.as_ref().is_none_or(|(offset_y, _)| *offset_y != wanted[1]) {
                    // Frees memory before the next ones are made.
                    drop(samples.take());
                    samples = BandSamples::new(setup, errors, wanted[1]).map(|samples| (wanted[1], samples));
                }
                let Some((_, samples)) = &samples else { return };
                RowSpectra::of_band(setup, samples, wanted[0])
            }
            _ => return,
        };
        waiting.retain(|&i| {
            let shares = shared(places_px[i]) == wanted;
            if shares {
                use_transfer(i, spectra.transfer([0, 1].map(|axis| places_px[i][axis] != wanted[axis])));
            }
            !shares
        });
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
struct RowSpectra<T> {
    height_px: usize,
    width_px: usize,
    values: Vec<Complex<T>>,
}

impl<T: Real> RowSpectra<T> {
    fn of_pixels(setup: &OpticalSetup, [offset_x, offset_y]: [f64; 2]) -> Self {
        let (response, pitch_m) = (PixelResponse::new(setup), setup.grid().pixel_pitch_m());
        let gather = |_: Range<usize>, _: &mut Vec<Complex32>| {};
        Self::new(setup, gather, |lag_y, _, Scratch { sequence, .. }| {
            let (y_m, width_px) = ((lag_y + offset_y) * pitch_m, sequence.len() / 2);
            let at = |column: usize| {
                lag(column, width_px).map_or(Complex64::ZERO, |lag_x| response.at((lag_x + offset_x) * pitch_m, y_m))
            };
            if offset_x == 0.0 {
                (0..width_px).for_each(|column| sequence[column] = at(column));
                (1..width_px).for_each(|column| sequence[2 * width_px - column] = sequence[column]);
            } else {
                sequence.iter_mut().enumerate().for_each(|(column, value)| *value = at(column));
            }
        })
    }

    fn of_band(setup: &OpticalSetup, samples: &BandSamples, offset_x: f64) -> Self {
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

    /// Transfer function to the sub-sample on the other side of the pixel along each axis where `mirrored` is true.
    fn transfer(&self, mirrored: [bool; 2]) -> Transfer<T> {
        let (height_px, width_px) = (self.height_px, self.width_px);
        let fft = FftPlanner::new().plan_fft_forward(2 * height_px);
        let mirror = |i: usize, len: usize, mirrored: bool| if mirrored { (len - i) % len } else { i };
        let scratch = || (vec![Complex64::ZERO; fft.get_inplace_scratch_len()], Vec::new());
        let mut transfer = Transfer::zeros(height_px, width_px);
        // Columns of a tile are gathered together, because their bins are neighbours in memory.
        transfer.write_tiles(scratch, |(scratch, gathered), columns, tile| {
            let (count, rows) = (columns.len(), 2 * height_px);
            gathered.resize(count * rows, Complex64::ZERO);
            for row in 0..rows {
                interrupt::check();
                let from = &self.values[mirror(row, rows, mirrored[1]) * 2 * width_px..][..2 * width_px];
                for (k, i) in columns.clone().enumerate() {
                    gathered[k * rows + row] = widened(from[mirror(split_bin(i, width_px), 2 * width_px, mirrored[0])]);
                }
            }
            fft.process_with_scratch(gathered, scratch);
            let tile_columns = tile.len() / rows;
            for (row, out) in tile.chunks_exact_mut(tile_columns).enumerate() {
                let bin = split_bin(row, height_px);
                out.iter_mut()
                    .zip(gathered[bin..].iter().step_by(rows))
                    .for_each(|(out, exact)| *out = narrowed(*exact));
            }
        });
        transfer
    }
}

fn narrowed<T: Real>(value: Complex64) -> Complex<T> {
    Complex::new(T::of(value.re), T::of(value.im))
}

fn widened<T: Real>(value: Complex<T>) -> Complex64 {
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
