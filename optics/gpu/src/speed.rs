//! Time of an evaluation on a machine, by which a card is chosen.

use lightpath_optics::engine::Prepared;
use lightpath_optics::hologram::{Backend, Loss, Picture};
use lightpath_optics::metrics::Gain;
use lightpath_optics::{Detector, DisplayModel, Grid, OpticalSetup, Plane, RegionOfInterest, Result};
use std::time::{Duration, Instant};

/// Number of timed evaluations, of which the middle one counts. The first one, which is not timed, allocates and, on a
/// card, compiles.
const TIMED: usize = 5;

/// Time of one evaluation of loss and gradient for an ideal display of this size with the detector `pixel`.
///
/// # Errors
///
/// [`Error`](lightpath_optics::Error) for a size that the backend does not compute.
pub fn evaluation_time(backend: &dyn Backend, height_px: usize, width_px: usize) -> Result<Duration> {
    let grid = Grid::try_new(height_px, width_px, 8e-6)?;
    let model = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 0.05)?);
    let display = Prepared::new(&model, Detector::Pixel, None)?;
    // The time does not depend on the picture.
    let target = Plane::filled(height_px, width_px, 0.5);
    let picture = Picture { display, target, weight: None, share: 1.0 };
    let mut problem = backend.hologram(vec![picture], 1, RegionOfInterest::middle(&grid), Loss::default())?;
    let phase: Vec<f32> = (0..height_px * width_px).map(|i| (i % 997) as f32 * 0.006).collect();
    let mut gradient = vec![0.0; phase.len()];
    let mut timed = || {
        let begin = Instant::now();
        problem.evaluate(&phase, Gain::Given(1.0), &mut gradient);
        begin.elapsed()
    };
    timed();
    let mut times: Vec<_> = (0..TIMED).map(|_| timed()).collect();
    times.sort_unstable();
    Ok(times[TIMED / 2])
}
