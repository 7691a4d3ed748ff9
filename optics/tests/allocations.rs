//! An optimization allocates no memory after its first steps.
//!
//! This test is a binary of its own, because it counts the allocations of the whole process.
#![allow(clippy::unwrap_used)]

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, ImagePlane, InitialPhase, Loss};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, RegionOfInterest,
};
use rayon::ThreadPoolBuilder;

#[global_allocator]
static ALLOCATOR: dhat::Alloc = dhat::Alloc;

const HEIGHT_PX: usize = 90;
const WIDTH_PX: usize = 128;
/// Steps before the count starts. L-BFGS fills its history in these steps.
const FIRST_STEPS: usize = 16;
const STEPS: usize = 8;

fn optimization(method: HologramMethod, detector: Detector, planes: usize) -> Optimization {
    let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap();
    let setup = |p: usize| OpticalSetup::try_new(grid, 515e-9, 0.01 * (p + 1) as f64).unwrap();
    let image_planes = (0..planes).map(|p| {
        let engine = Engine::new(&DisplayModel::ideal(setup(p)), detector, None).unwrap();
        ImagePlane::new(engine, TestCard::Portrait.render(HEIGHT_PX, WIDTH_PX, p as u64).unwrap())
    });
    let region = RegionOfInterest::middle(&grid);
    let problem = HologramProblem::with_planes(image_planes.collect(), 1, region, Loss::default()).unwrap();
    let phases = InitialPhase::Random { range_rad: 1.0 }.phases(&problem, &setup(0), 1).unwrap();
    Optimization::start(problem, HologramOptions::new(method, 100), phases).unwrap()
}

#[test]
fn iterations_allocate_nothing() {
    let profiler = dhat::Profiler::builder().testing().build();
    // A second thread would allocate when it first has work to do, which may be at any time.
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        for method in
            [HologramMethod::Adam { learning_rate: 0.1 }, HologramMethod::Lbfgs, HologramMethod::GerchbergSaxton]
        {
            for (detector, planes) in [(Detector::Point, 1), (Detector::Pixel, 2), (Detector::Supersampled, 1)] {
                let mut optimization = optimization(method, detector, planes);
                (0..FIRST_STEPS).for_each(|_| assert!(optimization.step().is_some()));
                let before = dhat::HeapStats::get();
                (0..STEPS).for_each(|_| assert!(optimization.step().is_some()));
                let after = dhat::HeapStats::get();
                let name = format!("{method:?}, {detector:?}, {planes} planes");
                assert_eq!(after.total_blocks - before.total_blocks, 0, "{name}");
            }
        }
    });
    drop(profiler);
}
