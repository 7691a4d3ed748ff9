//! The functions of `BenchSize` against counted allocations.
//!
//! This test is a binary of its own, because it counts the allocations of the whole process.
#![allow(clippy::unwrap_used)]

use lightpath_bench::{BenchSize, SimulatedBench, SimulatedDisplay};
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::memory::EngineSize;
use lightpath_optics::{Detector, Grid, OpticalSetup, Orders};
use peak_alloc::PeakAlloc;
use rayon::{ThreadPool, ThreadPoolBuilder};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Allocations that no function counts: those of threads, tables and small vectors \[bytes\].
const SMALL_BYTES: u64 = 1_000_000;

/// An estimate that is below the counted peak, or more than 1.1 times as large.
fn wrong(pool: &ThreadPool, name: &str, orders: Orders, bench: SimulatedBench) -> Option<String> {
    let grid = Grid::try_new(120, 160, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 0.01).unwrap().with_orders(orders).unwrap();
    let engine = EngineSize::ideal(120, 160, Detector::Pixel, 2).sampled_with(&setup, false);
    let estimate = BenchSize::new(engine, bench).simulation_bytes();
    let phase = initial_phase(120, 160, 6.0, 1).unwrap();
    let before = ALLOCATOR.current_usage();
    ALLOCATOR.reset_peak_usage();
    pool.install(|| SimulatedDisplay::draw(setup, None, bench).unwrap().capture(&phase, 1).unwrap());
    let peak = (ALLOCATOR.peak_usage() - before) as u64;
    let ratio = estimate as f64 / peak as f64;
    eprintln!("{name}: {estimate} estimated, {peak} counted, ratio {ratio:.3}");
    let is_wrong = estimate + SMALL_BYTES < peak || ratio > 1.1;
    is_wrong.then(|| format!("{name}: {estimate} bytes estimated, {peak} bytes counted"))
}

#[test]
fn counted_memory_of_simulated_displays_is_that_of_the_functions() {
    let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let fair = SimulatedBench { speckle_contrast: 0.1, ..SimulatedBench::FAIR };
    let varying = SimulatedBench { field_aberration_rad: 2.0, ..fair };
    let flaws = SimulatedBench { surface_waves: 1.0, dust_contrast: 0.1, response_variation: 0.1, ..fair };
    let six_modes = SimulatedBench { source_angle_rad: 0.3e-3, bandwidth: 0.01, ..flaws };
    let two_modes = SimulatedBench { bandwidth: 0.01, ..fair };
    let cases = [
        ("bench", Orders::First, fair),
        ("bench, varying", Orders::First, varying),
        ("bench of all orders", Orders::SQUARE, fair),
        ("bench of all orders, varying", Orders::SQUARE, varying),
        ("bench, six modes", Orders::First, six_modes),
        ("bench of all orders, two modes", Orders::SQUARE, two_modes),
    ];
    let wrong: Vec<_> =
        cases.into_iter().filter_map(|(name, orders, bench)| wrong(&pool, name, orders, bench)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
