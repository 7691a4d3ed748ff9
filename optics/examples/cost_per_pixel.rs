//! Measures how the cost of a pixel grows with the size of the hologram: a step of Adam at 540p, 1080p and 4K.
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example cost_per_pixel            # 9 steps of each
//! cargo run --release -p lightpath-optics --example cost_per_pixel -- 3       # 3 steps of each
//! ```
//!
//! The sizes take turns, so that other load on the machine affects all of them alike. Each time is the median of the
//! steps.

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, initial_phase};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, RegionOfInterest,
};
use std::error::Error;
use std::io::Write as _;
use std::time::Instant;

const SIZES: [(&str, usize, usize); 3] = [("540p", 540, 960), ("1080p", 1080, 1920), ("4K", 2160, 3840)];

fn main() -> Result<(), Box<dyn Error>> {
    let steps: usize = std::env::args().nth(1).map_or(Ok(9), |steps| steps.parse())?;
    let mut out = std::io::stdout();
    let threads = rayon::current_num_threads();
    writeln!(out, "Adam, ms a step (ns a pixel), median of {steps}, {threads} threads\n")?;
    writeln!(out, "| detector | 540p | 1080p | 4K | a 4K pixel against a 540p pixel |\n|---|---|---|---|---|")?;
    for (name, detector) in
        [("point", Detector::Point), ("pixel", Detector::Pixel), ("supersampled", Detector::Supersampled)]
    {
        let mut runs = Vec::new();
        for (_, height_px, width_px) in SIZES {
            runs.push((start(height_px, width_px, detector)?, Vec::new()));
        }
        for _ in 0..steps.max(1) {
            for (adam, times_s) in &mut runs {
                let started = Instant::now();
                adam.step();
                times_s.push(started.elapsed().as_secs_f64());
            }
        }
        let per_pixel = runs.iter_mut().zip(SIZES).map(|((_, times_s), (_, height_px, width_px))| {
            times_s.sort_by(f64::total_cmp);
            (times_s[times_s.len() / 2], (height_px * width_px) as f64)
        });
        let per_pixel: Vec<_> = per_pixel.collect();
        let cells = per_pixel.iter().map(|(s, pixels)| format!(" {:.1} ({:.1}) |", 1e3 * s, 1e9 * s / pixels));
        let [first, .., last] = per_pixel[..] else { unreachable!("three sizes") };
        let growth = (last.0 / last.1) / (first.0 / first.1) - 1.0;
        writeln!(out, "| {name} |{} {:+.0} % |", cells.collect::<String>(), 100.0 * growth)?;
    }
    Ok(())
}

fn start(height_px: usize, width_px: usize, detector: Detector) -> Result<Optimization, Box<dyn Error>> {
    let grid = Grid::try_new(height_px, width_px, 8e-6)?;
    let model = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 0.15)?);
    let target = TestCard::Portrait.render(height_px, width_px, 1)?;
    let problem = HologramProblem::new(Engine::new(&model, detector, None)?, target, RegionOfInterest::middle(&grid))?;
    let options = HologramOptions::new(HologramMethod::Adam { learning_rate: 0.1 }, u32::MAX);
    let mut adam = Optimization::start(problem, options, initial_phase(height_px, width_px, 1.0, 1)?.into_vec())?;
    // The first step is not counted, because it allocates the threads' working memory.
    adam.step();
    Ok(adam)
}
