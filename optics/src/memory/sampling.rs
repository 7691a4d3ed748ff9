//! Memory and work of sampling a transfer function.

use super::value_bytes::{COMPLEX, COMPLEX_F64};
use crate::display::{Detector, OpticalSetup};
use crate::engine::{reported_nodes, sub_samples};
use crate::propagation::passes::{band_samples, frequencies, is_even, peak_values};
use crate::propagation_method::ConvolutionMethod;

/// Time of sampling the response of a pixel at one lag and of the transforms of four sub-samples, in radix-2 stages of
/// a value.
pub(super) const RESPONSE_STAGES: u64 = 400;
/// Time of sampling one frequency of the band response and of its transforms, in radix-2 stages of a value.
const BAND_STAGES: u64 = 260;
/// Time of the four exact transfer functions of a report, in radix-2 stages of a frequency of a quarter of the band, if
/// the response is even.
const EVEN_SAMPLES_STAGES: u64 = 400;
/// The same if the response is not even, behind a filter.
const FILTERED_SAMPLES_STAGES: u64 = 2400;
/// The same behind errors, and for the light at the pixels' centres as well.
const SAMPLES_STAGES: u64 = 5200;

/// Memory for the sampling of a transfer function, besides it: frequencies and lags in f64.
#[must_use]
pub fn sampling_bytes(setup: &OpticalSetup) -> u64 {
    let grid = setup.grid();
    let padded = padded_values(setup);
    let values = match setup.method() {
        // In single precision: the response along y, then its rows, then the columns.
        ConvolutionMethod::BandResponse if setup.orders().filter().is_some() => {
            (band_samples(setup, false).max(padded) + padded) / 2
        }
        ConvolutionMethod::BandResponse => peak_values(setup),
        // In single precision.
        ConvolutionMethod::AllOrders => padded / 2,
        ConvolutionMethod::RayleighSommerfeld => 2 * quadrant(grid.height_px(), grid.width_px()),
        ConvolutionMethod::FresnelImpulseResponse => 2 * (grid.height_px() + grid.width_px()) as u64,
        _ => 0,
    };
    values * COMPLEX_F64
}

/// Work of sampling a transfer function, in values times radix-2 stages.
#[must_use]
pub fn sampling_work(setup: &OpticalSetup) -> u64 {
    let grid = setup.grid();
    match setup.method() {
        ConvolutionMethod::BandResponse if setup.orders().filter().is_some() => 4 * frequencies(setup) * BAND_STAGES,
        ConvolutionMethod::BandResponse => frequencies(setup) * BAND_STAGES,
        ConvolutionMethod::AllOrders => {
            // Those of a quarter of a pixel, whose mirror images are the others.
            let responses = sub_samples(setup, Detector::Pixel).len().div_ceil(4) as u64;
            responses * padded_values(setup) * RESPONSE_STAGES
        }
        _ => 2 * quadrant(grid.height_px(), grid.width_px()) * BAND_STAGES,
    }
}

/// Size of the exact transfer functions to places in the pixels, with which a report measures the light of a display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExactSize {
    /// Memory for their sampling, besides them \[bytes\].
    pub bytes: u64,
    /// Work of their sampling, in values times radix-2 stages.
    pub work: u64,
    /// Number of places in a pixel, besides its centre.
    pub places: u64,
    /// Number of transfer functions that a cache keeps: one for the places that are mirror images.
    pub(super) kept: u64,
}

impl ExactSize {
    /// `has_errors`: behind smooth errors of the display's kernel.
    pub(super) fn of(setup: &OpticalSetup, has_errors: bool) -> Self {
        const SUB_SAMPLES: u64 = 4;
        let quarter = |[x, y]: [usize; 2]| (x.div_ceil(2) * y.div_ceil(2)) as u64;
        let (work, places, kept) = match setup.method() {
            ConvolutionMethod::AllOrders => {
                let [x, y] = reported_nodes(setup);
                // Those of the sub-samples, and of the nodes in a quarter of a pixel.
                let responses = 1 + quarter([x, y]);
                (responses * padded_values(setup) * RESPONSE_STAGES, SUB_SAMPLES + (x * y) as u64, responses)
            }
            _ => {
                let stages = match (has_errors, is_even(setup, has_errors)) {
                    (true, _) => SAMPLES_STAGES,
                    (false, true) => EVEN_SAMPLES_STAGES,
                    (false, false) => FILTERED_SAMPLES_STAGES,
                };
                let [x, y] = if setup.camera_fill_factor() < 1.0 { reported_nodes(setup) } else { [0; 2] };
                let places = SUB_SAMPLES + (x * y) as u64;
                let kept = match (has_errors, is_even(setup, has_errors)) {
                    (true, _) => 0,
                    (false, true) => 1 + quarter([x, y]),
                    (false, false) => places,
                };
                (frequencies(setup) * stages * places / SUB_SAMPLES, places, kept)
            }
        };
        Self { bytes: band_samples(setup, has_errors) * COMPLEX, work, places, kept }
    }
}

/// Number of values of a transfer function on the padded frame.
fn padded_values(setup: &OpticalSetup) -> u64 {
    4 * setup.grid().height_px() as u64 * setup.grid().width_px() as u64
}

/// Number of lags or frequencies that determine an even transfer function.
pub(super) fn quadrant(height_px: usize, width_px: usize) -> u64 {
    (height_px as u64 + 1) * (width_px as u64 + 1)
}
