//! Measures what a hologram job costs: processor seconds of its start, of its iterations and of each part of its judging.
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example job_cost                 # 1, 20 and 200 steps at 1920×1080
//! cargo run --release -p lightpath-optics --example job_cost -- 20 960x540   # 20 steps at 960×540
//! ```
//!
//! Prints the seconds of the whole job for each choice of judging, of its parts, and the PSNR that the judgements found.
//! Each job runs twice with one cache of engines, as jobs of one server do: the second finds what the first one made for
//! the display and the distance. The seconds are those of all threads together, and exist on Linux only.

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{
    HologramMethod, HologramOptions, InitialPhase, ShownLight, Wanted, light_of_frames, pixel_psnr_db,
    with_other_orders,
};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{
    Detector, DisplayModel, EngineCache, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};
use std::error::Error;
use std::io::Write as _;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let steps = match arguments.next() {
        Some(steps) => vec![steps.parse()?],
        None => vec![1, 20, 200],
    };
    let size = arguments.next().unwrap_or("1920x1080".to_owned());
    let (width_px, height_px) = size.split_once('x').ok_or("the size is not WIDTHxHEIGHT")?;
    let (width_px, height_px) = (width_px.parse()?, height_px.parse()?);
    let target = TestCard::Portrait.render(height_px, width_px, 1)?;
    for steps in steps {
        let cache = EngineCache::new(1 << 30);
        for which in ["first", "second"] {
            let mut costs = Costs { before_s: processor_s()?, parts: Vec::new() };
            let psnr_db = job(&cache, &mut costs, &target, steps)?;
            let parts = costs.parts.iter().map(|(part, s)| format!("{part} {s:.2}")).collect::<Vec<_>>().join(", ");
            let mut totals = Vec::new();
            for (judge, left_out) in [("full", &[][..]), ("quick", &OTHERS[..]), ("none", &JUDGING[..])] {
                let kept = costs.parts.iter().filter(|(part, _)| !left_out.contains(part));
                totals.push(format!("{judge} {:.1} s", kept.map(|(_, s)| s).sum::<f64>()));
            }
            let totals = totals.join(", ");
            writeln!(std::io::stdout(), "{steps} steps, {which} job: {totals}; {parts}; {psnr_db:.4?} dB")?;
        }
    }
    Ok(())
}

/// Parts that a quick judging leaves out.
const OTHERS: [&str; 2] = ["second opinion", "other orders"];
/// Parts that only judge.
const JUDGING: [&str; 4] = ["light", "quality", "second opinion", "other orders"];

/// Processor seconds of the parts of a job.
struct Costs {
    before_s: f64,
    parts: Vec<(&'static str, f64)>,
}

impl Costs {
    /// Adds what was spent since the last part.
    fn add(&mut self, part: &'static str) -> Result<(), Box<dyn Error>> {
        let now_s = processor_s()?;
        self.parts.push((part, now_s - self.before_s));
        self.before_s = now_s;
        Ok(())
    }
}

/// Runs a job with the defaults of the server, without its files. Returns the figures of its judgements \[dB\].
fn job(cache: &EngineCache, costs: &mut Costs, target: &Plane<f32>, steps: u32) -> Result<Vec<f64>, Box<dyn Error>> {
    let (height_px, width_px) = (target.height_px(), target.width_px());
    let grid = Grid::try_new(height_px, width_px, 8e-6)?;
    let (setup, _) = OpticalSetup::try_new(grid, 515e-9, 0.15)?.planned()?;
    let (model, region, method) = (DisplayModel::ideal(setup), RegionOfInterest::middle(&grid), HologramMethod::Lbfgs);
    let engine = cache.engine(&model, Detector::Pixel, None)?;
    costs.add("engine")?;
    let problem = HologramProblem::new(engine.clone(), target.clone(), region)?;
    let phase = InitialPhase::recommended(method, Detector::Pixel, 1).phases(&problem, &setup, 1)?;
    let mut optimization = Optimization::start(problem, HologramOptions::new(method, steps), phase)?;
    costs.add("initial phase")?;
    while optimization.step().is_some() {}
    costs.add("steps")?;
    let phases = [Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?];
    let level = std::f32::consts::TAU / 256.0;
    let displayed = phases.each_ref().map(|phase| phase.map(|phi| (phi / level).round() * level));
    optimization.measure(displayed[0].values())?;
    drop(optimization);
    costs.add("gain")?;
    light_of_frames(&engine, &displayed)?;
    costs.add("reconstruction")?;
    let wanted: Wanted<'_> = (target, region).into();
    let shown = ShownLight::of_sets(&engine, &[&phases, &displayed])?;
    costs.add("light")?;
    let quality = [shown[0].quality(wanted)?, shown[1].quality(wanted)?];
    costs.add("quality")?;
    let opinion = SecondOpinion::of((&model, None), &displayed, &shown[1], Detector::Pixel, wanted, Effort::CHEAP)?
        .ok_or("none")?;
    costs.add("second opinion")?;
    let other = with_other_orders(&model).map(|model| pixel_psnr_db(cache, &model, &displayed, wanted)).transpose()?;
    costs.add("other orders")?;
    let SecondOpinion { engine_psnr_db, independent_psnr_db, .. } = opinion;
    let quality = quality.iter().flat_map(|q| [q.point.psnr_db, q.pixel.psnr_db, q.supersampled.psnr_db]);
    Ok(quality.chain([engine_psnr_db, independent_psnr_db]).chain(other).collect())
}

/// Processor time of all threads of this process so far \[s\].
fn processor_s() -> Result<f64, Box<dyn Error>> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let (_, after_name) = stat.rsplit_once(')').ok_or("unknown format of /proc/self/stat")?;
    // User and system time are the fields 14 and 15 of the line, in hundredths of a second.
    let ticks = after_name.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
    Ok(ticks.sum::<Result<f64, _>>()? / 100.0)
}
