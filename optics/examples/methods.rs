//! Every method on a generated picture: how good it is after as many steps, and how long they take.
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example methods [-- HEIGHT WIDTH STEPS]
//! ```

use lightpath_optics::hologram::{InitialPhase, Method, Options, quality};
use lightpath_optics::test_cards::TestCard;
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest, Result,
};
use std::io::Write as _;
use std::time::Instant;

fn main() -> Result<()> {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse().unwrap_or(0));
    let mut number = |default| numbers.next().filter(|number| *number > 0).unwrap_or(default);
    let (height_px, width_px, steps) = (number(540), number(960), number(100) as u32);
    let grid = Grid::try_new(height_px, width_px, 8e-6)?;
    let setup = OpticalSetup::try_new(grid, 515e-9, 0.15)?;
    let region = RegionOfInterest::middle(&grid);
    let target = TestCard::Portrait.render(height_px, width_px, 1)?;
    let mut out = std::io::stdout().lock();
    // A closed pipe ends the table early, and nothing else.
    drop(writeln!(out, "method      detector       point    pixel    supersampled   ms a step"));
    for detector in Detector::ALL {
        let engine = Engine::of_display(&DisplayModel::ideal(setup), detector, None)?;
        for (name, method) in [
            ("lbfgs", Method::Lbfgs),
            ("adam", Method::Adam { learning_rate: 0.1 }),
            ("gs", Method::GerchbergSaxton),
            ("wgs", Method::WeightedGerchbergSaxton),
            ("dpac", Method::DoublePhase),
        ] {
            let problem = HologramProblem::new(engine.clone(), target.clone(), region)?;
            let initial = match method {
                Method::DoublePhase => InitialPhase::Constant { phase_rad: 0.0 },
                _ => InitialPhase::Random { range_rad: 1.0 },
            };
            let phases = initial.phases(&problem, &setup, 1)?;
            let mut optimization = Optimization::start(problem, Options::new(method, steps), phases)?;
            let started = Instant::now();
            let mut taken = 0;
            while optimization.step().is_some() {
                taken += 1;
            }
            let step_ms = 1e3 * started.elapsed().as_secs_f64() / f64::from(taken);
            let phase = Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?;
            let found = quality(&engine, &phase, &target, region)?;
            let [point, pixel, eye] = [found.point, found.pixel, found.supersampled].map(|seen| seen.psnr_db);
            let line = format!("{name:8} {detector:>12?} {point:8.1} dB {pixel:5.1} dB {eye:8.1} dB {step_ms:12.1}");
            drop(writeln!(out, "{line}"));
        }
    }
    Ok(())
}
