//! Transfer functions from the display to each sub-sample of the image.
//!
//! The exact transfer function to a sub-sample is the Fourier transform of the response of a pixel at that place:
//!
//! ```text
//! H_o(f) = Σ g((n + o)Δ) e^{−i2πfn}   over the lags n between two pixels of the frame
//! ```
//!
//! o is the place of the sub-sample from the centre of the pixel \[px\], g the response of a
//! pixel of a display that shows all orders, or of the band of one that
//! shows the first. g is even along both axes, so the sub-samples (±o_x, ±o_y) share its values.

use super::convolution::{Real, Transfer, split_bin};
use crate::display::OpticalSetup;
use crate::display::parts::ghost::TransferErrors;
use crate::interrupt;
use crate::propagation::passes::{BandSamples, RowSpectra, is_even, narrowed, widened};
use crate::propagation_method::ConvolutionMethod;
use lightpath_fft::FftPlanner;
use num_complex::Complex64;

/// Transfer functions to the sub-samples at these places (x, y) from the centre of the pixel \[px\].
pub(crate) fn sample_transfers<T: Real>(setup: &OpticalSetup, places_px: &[[f64; 2]]) -> Vec<Transfer<T>> {
    let mut transfers: Vec<Option<Transfer<T>>> = places_px.iter().map(|_| None).collect();
    for_each_sample_transfer(setup, None, places_px, |i, transfer| transfers[i] = Some(transfer));
    transfers.into_iter().flatten().collect()
}

/// Calls `use_transfer(i, transfer)` with the transfer function to each of the places, in an order in which places
/// share what they can. On a display that shows the first order, it is that behind smooth `errors` of its kernel. Only
/// one transfer function exists at a time. None if the setup has none.
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
                use_transfer(i, transfer(&spectra, [0, 1].map(|axis| places_px[i][axis] != wanted[axis])));
            }
            !shares
        });
    }
}

/// Transfer function to the sub-sample on the other side of the pixel along each axis where `mirrored` is true.
fn transfer<T: Real>(spectra: &RowSpectra<T>, mirrored: [bool; 2]) -> Transfer<T> {
    let (height_px, width_px) = (spectra.height_px, spectra.width_px);
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
            let from = &spectra.values[mirror(row, rows, mirrored[1]) * 2 * width_px..][..2 * width_px];
            for (k, i) in columns.clone().enumerate() {
                gathered[k * rows + row] = widened(from[mirror(split_bin(i, width_px), 2 * width_px, mirrored[0])]);
            }
        }
        fft.process_with_scratch(gathered, scratch);
        let tile_columns = tile.len() / rows;
        for (row, out) in tile.chunks_exact_mut(tile_columns).enumerate() {
            let bin = split_bin(row, height_px);
            out.iter_mut().zip(gathered[bin..].iter().step_by(rows)).for_each(|(out, exact)| *out = narrowed(*exact));
        }
    });
    transfer
}
