//! Speed of this machine.

use lightpath_optics::hologram::{HologramMethod, HologramOptions};
use lightpath_optics::memory::{EngineSize, HologramSize};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Error, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};
use rayon::ThreadPoolBuilder;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Side of the hologram with which the speed is measured \[px\]. A larger one would leave the server with more memory,
/// because the allocator keeps some of what is freed.
const SIDE_PX: usize = 256;
/// Number of measured steps.
const STEPS: u32 = 10;
/// Work for each second of a machine whose speed cannot be measured: that of one slow core.
const WORK_PER_S: f64 = 2e8;

/// Work for each second of the optics engine on this many threads; 0 threads: one for each core. The unit is that of
/// `lightpath_optics::memory`.
#[must_use]
pub fn measured_work_per_s(threads: usize) -> f64 {
    /// Speeds that this process has measured, by their number of threads.
    static MEASURED: Mutex<BTreeMap<usize, f64>> = Mutex::new(BTreeMap::new());
    // The lock lasts as long as the measurement, so that two do not slow down each other.
    let mut measured = MEASURED.lock().unwrap_or_else(PoisonError::into_inner);
    *measured.entry(threads).or_insert_with(|| measure(threads))
}

fn measure(threads: usize) -> f64 {
    let Ok(pool) = ThreadPoolBuilder::new().num_threads(threads).build() else { return WORK_PER_S };
    pool.install(work_per_s).unwrap_or(WORK_PER_S)
}

fn work_per_s() -> Result<f64, Error> {
    let grid = Grid::try_new(SIDE_PX, SIDE_PX, 8e-6)?;
    let setup = OpticalSetup::try_new(grid, 515e-9, 0.05)?;
    let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None)?;
    // The time of a step does not depend on the picture.
    let target = Plane::filled(SIDE_PX, SIDE_PX, 0.5);
    let problem = HologramProblem::new(engine, target, RegionOfInterest::middle(&grid))?;
    let options = HologramOptions::new(HologramMethod::Lbfgs, STEPS + 1);
    let mut optimization = Optimization::start(problem, options, vec![0.5; SIDE_PX * SIDE_PX])?;
    // The first step allocates the buffers.
    optimization.step();
    let step = |_| {
        let started = Instant::now();
        optimization.step();
        started.elapsed().as_secs_f64()
    };
    // The median leaves out steps during which another program used the cores.
    let mut steps_s: Vec<f64> = (0..STEPS).map(step).collect();
    steps_s.sort_by(f64::total_cmp);
    let step_s = steps_s[steps_s.len() / 2];
    let size = HologramSize::new(EngineSize::ideal(SIDE_PX, SIDE_PX, Detector::Pixel, 1), HologramMethod::Lbfgs, STEPS);
    Ok(size.step_work() / step_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_is_measured() {
        let speed = measured_work_per_s(1);
        assert!(speed.is_finite() && speed > 1e6, "{speed:e}");
    }
}
