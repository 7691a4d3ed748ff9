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
use super::kept_transfers::KeptTransfers;
use crate::display::OpticalSetup;
use crate::display::parts::ghost::TransferErrors;
use crate::interrupt;
use crate::propagation::passes::{BandSamples, RowSpectra, is_even, narrowed, widened};
use crate::propagation_method::ConvolutionMethod;
use lightpath_fft::FftPlanner;
use num_complex::Complex64;
use std::sync::Arc;

/// Transfer functions to the sub-samples at these places (x, y) from the centre of the pixel \[px\].
pub(crate) fn sample_transfers<T: Real>(setup: &OpticalSetup, places_px: &[[f64; 2]]) -> Vec<Transfer<T>> {
    let mut transfers: Vec<Option<Transfer<T>>> = places_px.iter().map(|_| None).collect();
    for_each_sample_transfer((setup, None), None, places_px, |i, transfer| transfers[i] = Some(transfer));
    transfers.into_iter().flatten().collect()
}

/// Calls `use_transfer(i, transfer)` with the transfer function to each of the places, in an order in which places
/// share what they can. On a display that shows the first order, it is that behind smooth `errors` of its kernel. Only
/// one transfer function exists at a time, besides one whose mirror images are used. Those without errors are taken from
/// `kept` and kept there. None if the setup has none.
pub(crate) fn for_each_sample_transfer<T: Real>(
    (setup, errors): (&OpticalSetup, Option<&TransferErrors>),
    kept: Option<&dyn KeptTransfers<T>>,
    places_px: &[[f64; 2]],
    mut use_transfer: impl FnMut(usize, Transfer<T>),
) {
    // The places of an even response are mirror images.
    let is_even = is_even(setup, errors.is_some());
    let kept = kept.filter(|_| errors.is_none());
    let shared = |place: [f64; 2]| if is_even { place.map(f64::abs) } else { place };
    let mut waiting: Vec<usize> = (0..places_px.len()).collect();
    let mut samples: Option<(f64, BandSamples)> = None;
    while let Some(&first) = waiting.first() {
        let wanted = shared(places_px[first]);
        let found = kept.and_then(|kept| kept.find(setup, wanted));
        let Some(exact) = found.or_else(|| {
            let exact = Arc::new(transfer(spectra(setup, errors, wanted, &mut samples)?));
            kept.inspect(|kept| kept.keep(setup, wanted, &exact));
            Some(exact)
        }) else {
            return;
        };
        // The even response of a mirrored place has the opposite frequencies.
        let mut exact = Some(exact);
        let (same, others): (Vec<usize>, _) = waiting.iter().partition(|&&i| shared(places_px[i]) == wanted);
        waiting = others;
        for (n, &i) in same.iter().enumerate() {
            let mirrored = [0, 1].map(|axis| places_px[i][axis] != wanted[axis]);
            let last = n + 1 == same.len() && mirrored == [false; 2];
            let found = if last {
                exact.take().map(Arc::unwrap_or_clone)
            } else {
                exact.as_ref().map(|exact| exact.mirrored(mirrored))
            };
            found.into_iter().for_each(|found| use_transfer(i, found));
        }
    }
}

/// Spectra of the response at a place; `None`: the setup has none. `samples` are those of the last place, which others of
/// the same offset along y share.
fn spectra<T: Real>(
    setup: &OpticalSetup,
    errors: Option<&TransferErrors>,
    place_px: [f64; 2],
    samples: &mut Option<(f64, BandSamples)>,
) -> Option<RowSpectra<T>> {
    let [offset_x, offset_y] = place_px;
    match setup.method() {
        ConvolutionMethod::AllOrders => Some(RowSpectra::of_pixels(setup, place_px)),
        ConvolutionMethod::BandResponse => {
            if samples.as_ref().is_none_or(|(offset, _)| *offset != offset_y) {
                // Frees memory before the next ones are made.
                drop(samples.take());
                *samples = BandSamples::new(setup, errors, offset_y).map(|samples| (offset_y, samples));
            }
            let (_, samples) = samples.as_ref()?;
            Some(RowSpectra::of_band(setup, samples, offset_x))
        }
        _ => None,
    }
}

/// Transfer function to a sub-sample.
fn transfer<T: Real>(spectra: RowSpectra<T>) -> Transfer<T> {
    let (height_px, width_px) = (spectra.height_px, spectra.width_px);
    let fft = FftPlanner::new().plan_fft_forward(2 * height_px);
    let scratch = || (vec![Complex64::ZERO; fft.get_inplace_scratch_len()], Vec::new());
    let mut transfer = Transfer::zeros(height_px, width_px);
    // Columns of a tile are gathered together, because their bins are neighbours in memory.
    transfer.write_tiles(scratch, |(scratch, gathered), columns, tile| {
        let (count, rows) = (columns.len(), 2 * height_px);
        gathered.resize(count * rows, Complex64::ZERO);
        for (row, from) in spectra.values.chunks_exact(2 * width_px).enumerate() {
            interrupt::check();
            for (k, i) in columns.clone().enumerate() {
                gathered[k * rows + row] = widened(from[split_bin(i, width_px)]);
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
