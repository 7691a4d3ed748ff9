//! Holograms for displays that show the first diffraction order of their pixels, and for those that show all orders,
//! each seen on both kinds.
//!
//! ```text
//! cargo run --release -p lightpath-optics --example orders
//! ```
#![allow(clippy::print_stdout)]

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, initial_phase, quality, with_other_orders};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Error, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};
use std::time::{Duration, Instant};

const HEIGHT_PX: usize = 360;
const WIDTH_PX: usize = 640;
const STEPS: u32 = 100;

fn main() -> Result<(), Error> {
    let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6)?;
    let (target, region) = (TestCard::Portrait.render(HEIGHT_PX, WIDTH_PX, 3)?, RegionOfInterest::middle(&grid));
    println!("{WIDTH_PX}×{HEIGHT_PX} px of 8 µm, 515 nm, {STEPS} steps of L-BFGS; PSNR integrated over the pixels");
    println!("| distance | optimized for | ms a step | seen: first order | seen: all orders |");
    println!("|---|---|---|---|---|");
    for distance_m in [20e-3, 45e-3, 70e-3, 120e-3, 200e-3] {
        let setup = OpticalSetup::try_new(grid, 515e-9, distance_m)?.planned()?.0;
        let first = DisplayModel::ideal(setup);
        let Some(all) = with_other_orders(&first) else { continue };
        let (first, all) = (Engine::new(&first, Detector::Pixel, None)?, Engine::new(&all, Detector::Pixel, None)?);
        for (name, engine) in [("first order", &first), ("all orders", &all)] {
            let (phase, step) = optimized(engine, &target, region)?;
            let seen = |engine| Ok(quality(engine, &phase, &target, region)?.pixel.psnr_db);
            let [on_first, on_all]: [Result<f64, Error>; 2] = [seen(&first), seen(&all)];
            let (mm, ms) = (1e3 * distance_m, 1e3 * step.as_secs_f64());
            println!("| {mm:.0} mm | {name} | {ms:.1} | {:.1} dB | {:.1} dB |", on_first?, on_all?);
        }
    }
    Ok(())
}

/// The phase of a hologram, and the time of a step.
fn optimized(engine: &Engine, target: &Plane<f32>, region: RegionOfInterest) -> Result<(Plane<f32>, Duration), Error> {
    let problem = HologramProblem::new(engine.clone(), target.clone(), region)?;
    let start = initial_phase(HEIGHT_PX, WIDTH_PX, 0.5, 4)?.into_vec();
    let mut optimization = Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, STEPS), start)?;
    let begin = Instant::now();
    while optimization.step().is_some() {}
    let phase = Plane::try_from_vec(HEIGHT_PX, WIDTH_PX, optimization.phases().to_vec())?;
    Ok((phase, begin.elapsed() / STEPS))
}
