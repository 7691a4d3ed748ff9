//! Measures how well interpolated kernels predict photographs between the photographed distances:
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example between_distances
//! ```
//!
//! The example simulates displays whose camera moves along a tilted rail and whose aberrations grow with the distance.
//! It learns each display from photographs at three distances together, and predicts photographs at distances between
//! them.
#![allow(clippy::print_stdout)] // an example prints its results

use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{
    BoxError, KernelModel, LearnOptions, Learner, LearningPairs, Pair, PairSource, compare, interpolated,
};
use lightpath_optics::{Detector, DisplayModel, Engine, Grid, OpticalSetup, RegionOfInterest};
use std::time::Instant;

const PHOTOGRAPHED_M: [f64; 3] = [35e-3, 40e-3, 45e-3];
const BETWEEN_M: [f64; 2] = [37e-3, 42.5e-3];
const PAIRS: usize = 8;
const SEEDS: u64 = 5;

/// Pairs of holograms and photographs, one list for each distance.
struct Photographs(Vec<Vec<Pair>>);

impl PairSource for Photographs {
    fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    fn plane(&self, index: usize) -> usize {
        index / PAIRS
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        Ok(self.0[index / PAIRS][index % PAIRS].clone())
    }
}

fn main() -> Result<(), BoxError> {
    println!(
        "held-out loss of the ideal kernel, the kernel of the nearest photographed distance, the interpolated kernel, \
         and the kernel learned at this distance; time to learn three distances"
    );
    for seed in 0..SEEDS {
        let start = Instant::now();
        let models = learned(seed, &PHOTOGRAPHED_M)?;
        let took_s = start.elapsed().as_secs_f64();
        for distance_m in BETWEEN_M {
            let bench = bench(seed, distance_m)?;
            let nearest = models.iter().min_by(|a, b| {
                let away = |model: &DisplayModel| (model.setup.distance_m() - distance_m).abs();
                away(a).total_cmp(&away(b))
            });
            let nearest = nearest.map(|model| DisplayModel { setup: bench.setup(), ..model.clone() });
            let ideal = DisplayModel::ideal(bench.setup());
            let between = interpolated(&models, bench.setup())?;
            let there = learned(seed, &[distance_m])?.swap_remove(0);
            print!("display {seed}, {:4} mm:", 1e3 * distance_m);
            for model in [Some(ideal), nearest, Some(between), Some(there)].into_iter().flatten() {
                print!("  {:.2e}", held_out_loss(&bench, &model)?);
            }
            println!("  {took_s:.1} s");
        }
    }
    Ok(())
}

fn bench(seed: u64, distance_m: f64) -> Result<SimulatedDisplay, BoxError> {
    let setup = OpticalSetup::try_new(Grid::try_new(180, 320, 8e-6)?, 515e-9, distance_m)?;
    let rail = SimulatedBench {
        seed,
        misalignment_px: 0.5,
        rail_tilt_rad: 0.01_f64.to_radians(),
        aberrations_at_m: 40e-3,
        ..SimulatedBench::FAIR
    };
    Ok(SimulatedDisplay::draw(setup.planned()?.0, None, rail)?)
}

/// Pairs of holograms and their photographs; half of the holograms are speckled and half are smooth.
fn photographs(bench: &SimulatedDisplay, count: usize, seed: u64) -> Result<Vec<Pair>, BoxError> {
    let grid = bench.setup().grid();
    let one = |i: u64| {
        let range_rad = if i.is_multiple_of(2) { 6.0 } else { 2.0 };
        let phase = initial_phase(grid.height_px(), grid.width_px(), range_rad, seed + i)?;
        let photo = bench.capture(&phase, seed + i)?.map(|level| f32::from(level) / 255.0);
        Ok(Pair { phase, photo })
    };
    (0..count as u64).map(one).collect()
}

/// Learns a display from photographs at these distances together.
fn learned(seed: u64, distances_m: &[f64]) -> Result<Vec<DisplayModel>, BoxError> {
    let benches = distances_m.iter().map(|&distance_m| bench(seed, distance_m)).collect::<Result<Vec<_>, _>>()?;
    let pairs = benches.iter().zip((1..).step_by(100)).map(|(bench, seed)| photographs(bench, PAIRS, seed));
    let training = Photographs(pairs.collect::<Result<_, _>>()?);
    let setups: Vec<OpticalSetup> = benches.iter().map(SimulatedDisplay::setup).collect();
    let region = RegionOfInterest::middle(&setups[0].grid());
    let options = LearnOptions { degree: Some(8), ..LearnOptions::new(KernelModel::Display, region) };
    let mut learner = Learner::start_joint(&setups, options, &training)?;
    while learner.step(LearningPairs::training_only(&training))?.is_some() {}
    Ok(learner.models())
}

fn held_out_loss(bench: &SimulatedDisplay, model: &DisplayModel) -> Result<f64, BoxError> {
    let engine = Engine::new(model, Detector::Pixel, None)?;
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let test = photographs(bench, 4, 90_000)?;
    let losses = test.iter().map(|pair| Ok(compare(&engine, pair, region)?.fitted_loss()));
    Ok(losses.collect::<Result<Vec<f64>, BoxError>>()?.iter().sum::<f64>() / test.len() as f64)
}
