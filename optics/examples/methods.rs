//! Compares all optimization methods on one picture, from different initial phases: the quality after
//! the same number of steps, and the time of the steps.
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example methods [-- STEPS [TARGET.npy]]
//! ```
//!
//! `TARGET.npy` holds intensities in linear light, float32, \[y\]\[x\]. The default target is a generated card of
//! 540×960 px.

mod npy;

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, InitialPhase, RANDOM_RANGE_RAD, quality};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};
use std::error::Error;
use std::io::Write as _;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let steps = arguments.next().map_or(Ok(100), |text| text.parse())?;
    let target = match arguments.next() {
        Some(path) => npy::read(&path)?,
        None => TestCard::Portrait.render(540, 960, 1)?,
    };
    let (height_px, width_px) = (target.height_px(), target.width_px());
    let grid = Grid::try_new(height_px, width_px, 8e-6)?;
    let (setup, _) = OpticalSetup::try_new(grid, 515e-9, 0.15)?.planned()?;
    let region = RegionOfInterest::middle(&grid);
    let back_propagated = InitialPhase::BackPropagated { range_rad: RANDOM_RANGE_RAD };
    let random = InitialPhase::Random { range_rad: RANDOM_RANGE_RAD };
    let quadratic = InitialPhase::Quadratic { focal_length_m: None };
    let constant = InitialPhase::Constant { phase_rad: 0.0 };
    let runs = [
        ("lbfgs", HologramMethod::Lbfgs, &back_propagated),
        ("lbfgs", HologramMethod::Lbfgs, &random),
        ("lbfgs", HologramMethod::Lbfgs, &quadratic),
        ("lbfgs", HologramMethod::Lbfgs, &constant),
        ("adam", HologramMethod::Adam { learning_rate: 0.1 }, &back_propagated),
        ("adam", HologramMethod::Adam { learning_rate: 0.1 }, &random),
        ("gs", HologramMethod::GerchbergSaxton, &random),
        ("wgs", HologramMethod::WeightedGerchbergSaxton, &random),
        ("dpac", HologramMethod::DoublePhase, &constant),
    ];
    let mut out = std::io::stdout().lock();
    // A closed pipe only ends the table early: write errors are ignored.
    drop(writeln!(out, "method  from            detector         point      pixel  supersampled  ms a step"));
    for detector in Detector::ALL {
        let engine = Engine::new(&DisplayModel::ideal(setup), detector, None)?;
        for (name, method, initial) in runs {
            let problem = HologramProblem::new(engine.clone(), target.clone(), region)?;
            let phases = initial.phases(&problem, &setup, 1)?;
            let mut optimization = Optimization::start(problem, HologramOptions::new(method, steps), phases)?;
            let started = Instant::now();
            let mut taken = 0;
            while optimization.step().is_some() {
                taken += 1;
            }
            let step_ms = 1e3 * started.elapsed().as_secs_f64() / f64::from(taken);
            let phase = Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?;
            let found = quality(&engine, &phase, &target, region)?;
            let [point, pixel, supersampled] =
                [found.point, found.pixel, found.supersampled].map(|quality| quality.psnr_db);
            let from = match initial {
                InitialPhase::BackPropagated { .. } => "back-propagated",
                InitialPhase::Random { .. } => "random",
                InitialPhase::Quadratic { .. } => "quadratic",
                _ => "constant",
            };
            let line = format!(
                "{name:7} {from:15} {detector:<12?} {point:6.1} dB {pixel:7.1} dB {supersampled:10.1} dB {step_ms:10.1}"
            );
            drop(writeln!(out, "{line}"));
        }
    }
    Ok(())
}
