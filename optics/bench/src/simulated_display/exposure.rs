//! Exposure of the camera.
//!
//! It is set once for a bench, as on a real one: for a speckled image that fills the region of interest, with some
//! headroom.

use super::draws::{Draws, Stream};
use lightpath_optics::propagation::SampledTransfer;
use lightpath_optics::reference::propagate;
use lightpath_optics::{Grid, Plane, RegionOfInterest};
use num_complex::Complex64;

/// Level that all but a thousandth of the pixels of a speckled image stay below, as a part of full scale.
const EXPOSED_TO: f64 = 0.9;

/// Computes the gain from intensity to full scales of the camera at which the brightest thousandth of a speckled image
/// reaches [`EXPOSED_TO`]. `image` makes the light on the camera's pixels of a field on the modulator.
pub(super) fn calibrate(
    ideal: &SampledTransfer,
    grid: Grid,
    source: &Plane<Complex64>,
    seed: u64,
    image: impl FnOnce(&Plane<Complex64>) -> Plane<f64>,
) -> f64 {
    let region = RegionOfInterest::middle(&grid);
    let mut draws = Draws::new(seed, Stream::Exposure);
    let speckles = Plane::from_fn(grid.height_px(), grid.width_px(), |y, x| {
        let speckle = Complex64::cis(draws.angle());
        if region.columns(y).is_some_and(|columns| columns.contains(&x)) { speckle } else { Complex64::ZERO }
    });
    let hologram = propagate(&speckles, grid.pixel_pitch_m(), |fx, fy| ideal.at(fx, fy).conj());
    let field = Plane::from_fn(grid.height_px(), grid.width_px(), |y, x| {
        source.at(y, x) * Complex64::cis(hologram.at(y, x).arg())
    });
    let light = image(&field);
    let rows = (0..grid.height_px()).filter_map(|y| region.columns(y).map(|columns| &light.row(y)[columns]));
    let mut values: Vec<f64> = rows.flatten().copied().collect();
    let brightest = values.len() - 1 - values.len() / 1000;
    let (_, &mut level, _) = values.select_nth_unstable_by(brightest, f64::total_cmp);
    EXPOSED_TO / level
}
