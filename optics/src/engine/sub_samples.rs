//! Places in a pixel at which its light is computed, with their weights.
//!
//! The light of the first order has details of up to one cycle per pixel, which the few fixed places of a
//! [`Detector`] hold. That of all orders is finer: light reaches a point of the image from directions up to the
//! display's sides, and the finest detail of the intensity there has
//!
//! ```text
//! ν = N Δ²/(λz) = z_c/2z cycles per pixel
//! ```
//!
//! N pixels along the axis, Δ pixel pitch \[m\], λ wavelength \[m\], z distance \[m\], z_c the critical distance. Such a
//! pixel is integrated by the quadrature of Gauss and Legendre along each axis, which needs somewhat more than πν/2
//! nodes. A camera whose pixels are sensitive in a part of their area only has its places nearer to the centre.

use crate::display::{Detector, OpticalSetup};
use crate::numerics::quadrature::gauss_legendre;
use std::f64::consts::FRAC_PI_2;

/// A place (x, y) from the centre of the pixel \[px\], and the weight of its light. The weights add up to 1.
pub(crate) type WeightedPlace = ([f64; 2], f64);

/// Fewest nodes along an axis.
const NODES_MIN: usize = 2;
/// Most nodes along an axis for a report. They integrate details of up to four cycles per pixel.
const REPORTED_NODES_MAX: usize = 8;
/// Most nodes along an axis for an optimization, which keeps a transfer function for each pair of them.
const OPTIMIZED_NODES_MAX: usize = 5;
/// Nodes of an optimization besides πν/2. One more would gain 0.3 dB of 61 at a quarter of the critical distance.
const SPARE_NODES: f64 = 0.5;
/// Finest details that the detector's own places hold [cycles per pixel].
const DETECTOR_CYCLES_MAX: f64 = 1.0;

/// The places along one axis at which an optimization computes the light of one order.
pub(crate) fn offsets_px(setup: &OpticalSetup, detector: Detector) -> Vec<f64> {
    let part = if detector == Detector::Pixel { setup.camera_fill_factor() } else { 1.0 };
    detector.offsets_px().iter().map(|offset_px| part * offset_px).collect()
}

/// The places at which an optimization computes the light of all orders.
pub(crate) fn sub_samples(setup: &OpticalSetup, detector: Detector) -> Vec<WeightedPlace> {
    let part = setup.camera_fill_factor();
    let along = |cycles: f64| match detector == Detector::Pixel && part * cycles > DETECTOR_CYCLES_MAX {
        true => {
            let nodes = (FRAC_PI_2 * part * cycles + SPARE_NODES).ceil() as usize;
            quadrature(nodes.min(OPTIMIZED_NODES_MAX), part)
        }
        false => {
            let own = offsets_px(setup, detector);
            own.iter().map(|&offset_px| (offset_px, 1.0 / own.len() as f64)).collect()
        }
    };
    pairs(finest_details(setup).map(along))
}

/// Numbers of nodes along x and y at which a report integrates the light over a pixel.
pub(crate) fn reported_nodes(setup: &OpticalSetup) -> [usize; 2] {
    let nodes = |cycles: f64| (FRAC_PI_2 * setup.camera_fill_factor() * cycles + 1.5).ceil() as usize;
    finest_details(setup).map(|cycles| nodes(cycles).clamp(NODES_MIN, REPORTED_NODES_MAX))
}

/// The places of [`reported_nodes`].
pub(super) fn reported_places(setup: &OpticalSetup) -> Vec<WeightedPlace> {
    pairs(reported_nodes(setup).map(|nodes| quadrature(nodes, setup.camera_fill_factor())))
}

/// Finest details of the light along x and y [cycles per pixel].
fn finest_details(setup: &OpticalSetup) -> [f64; 2] {
    if !setup.orders().are_all() {
        return [1.0; 2];
    }
    [setup.critical_distance_x_m(), setup.critical_distance_y_m()]
        .map(|critical_m| 0.5 * critical_m / setup.distance_m().abs())
}

/// Places and weights for the mean over a `part` of a pixel's side.
fn quadrature(nodes: usize, part: f64) -> Vec<(f64, f64)> {
    gauss_legendre(nodes).into_iter().map(|(node, weight)| (0.5 * part * node, 0.5 * weight)).collect()
}

/// All pairs of places along x and y, ordered by y, then by x.
fn pairs([along_x, along_y]: [Vec<(f64, f64)>; 2]) -> Vec<WeightedPlace> {
    let row = |&(y, weight_y): &(f64, f64)| {
        along_x.iter().map(move |&(x, weight_x)| ([x, y], weight_x * weight_y)).collect::<Vec<_>>()
    };
    along_y.iter().flat_map(row).collect()
}
