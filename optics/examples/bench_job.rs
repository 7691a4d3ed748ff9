//! Runs one hologram job from start to end and records the time of each iteration's loss. `bench/peers.py` runs it.
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example bench_job -- --card portrait --height 1080 --width 1920 --out target.npy
//! cargo run --release -p lightpath-optics --example bench_job -- --target target.npy --out phase.npy --detector pixel
//! ```
//!
//! Prints one line of JSON. Targets are intensities in linear light, phases are in radians; both are float32 `.npy`
//! files.

mod npy;

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, InitialPhase, RANDOM_RANGE_RAD, Step};
use lightpath_optics::{
    ConvolutionMethod, Detector, DisplayModel, Engine, Evaluation, Grid, HologramProblem, OpticalSetup, Optimization,
    Plane, RegionOfInterest,
};
use npyz::WriterBuilder as _;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse(std::env::args().skip(1))?;
    match options.text.get("card") {
        Some(name) => write_card(name, &options),
        None => run_job(&options),
    }
}

/// Options of the command line, given as `--name value`.
struct Options {
    text: BTreeMap<String, String>,
}

impl Options {
    fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Self, Box<dyn Error>> {
        let mut text = BTreeMap::new();
        while let Some(name) = arguments.next() {
            let name = name.strip_prefix("--").ok_or_else(|| format!("{name} is not an option"))?.to_owned();
            let value = arguments.next().ok_or_else(|| format!("--{name} needs a value"))?;
            text.insert(name, value);
        }
        Ok(Self { text })
    }

    fn number<T: std::str::FromStr>(&self, name: &str, default: T) -> Result<T, String> {
        match self.text.get(name) {
            None => Ok(default),
            Some(text) => text.parse().map_err(|_| format!("--{name} is {text}, but must be a number")),
        }
    }

    fn word(&self, name: &str) -> Result<&str, String> {
        self.text.get(name).map(String::as_str).ok_or_else(|| format!("--{name} is required"))
    }
}

fn write_card(name: &str, options: &Options) -> Result<(), Box<dyn Error>> {
    let card = TestCard::ALL.into_iter().find(|card| card.name() == name).ok_or_else(|| {
        format!("--card {name} is not a card; cards are {}", TestCard::ALL.map(TestCard::name).join(", "))
    })?;
    let plane =
        card.render(options.number("height", 1080)?, options.number("width", 1920)?, options.number("seed", 1)?)?;
    write_npy(options.word("out")?, &plane)
}

fn run_job(options: &Options) -> Result<(), Box<dyn Error>> {
    rayon::ThreadPoolBuilder::new().num_threads(options.number("threads", 2)?).build_global()?;
    let target = npy::read(options.word("target")?)?;
    let detector = match options.text.get("detector").map_or("pixel", String::as_str) {
        "point" => Detector::Point,
        "pixel" => Detector::Pixel,
        "supersampled" => Detector::Supersampled,
        other => {
            return Err(
                format!("--detector {other} is not a detector; detectors are point, pixel and supersampled").into()
            );
        }
    };
    let iterations: u32 = options.number("iterations", 200)?;
    // The job ends when −10·log₁₀ of the loss reaches this quality [dB].
    let until_db: f64 = options.number("until-db", f64::INFINITY)?;

    let started = Instant::now();
    let (height_px, width_px) = (target.height_px(), target.width_px());
    let grid = Grid::try_new(height_px, width_px, options.number("pitch", 8e-6)?)?;
    let setup = OpticalSetup::try_new(grid, options.number("wavelength", 515e-9)?, options.number("distance", 0.15)?)?;
    let setup = match options.text.get("propagation").map_or("planned", String::as_str) {
        "planned" => setup.planned()?.0,
        "band-limited" => setup.with_method(ConvolutionMethod::BandLimited)?,
        other => {
            return Err(format!("--propagation {other} is not a choice; choices are planned and band-limited").into());
        }
    };
    let region = match options.text.get("region").map_or("middle", String::as_str) {
        "middle" => RegionOfInterest::middle(&grid),
        "full" => RegionOfInterest::full(&grid),
        other => return Err(format!("--region {other} is not a region; regions are middle and full").into()),
    };
    let problem = HologramProblem::new(Engine::new(&DisplayModel::ideal(setup), detector, None)?, target, region)?;
    let method = method(options)?;
    let phase = initial_phase(options, method, detector)?.phases(&problem, &setup, options.number("seed", 1)?)?;
    let mut optimization = Optimization::start(problem, HologramOptions::new(method, iterations), phase)?;
    let (mut time_s, mut loss) = (Vec::new(), Vec::new());
    while let Some(Step { evaluation: Evaluation { best_loss, .. }, .. }) = optimization.step() {
        time_s.push(started.elapsed().as_secs_f64());
        loss.push(best_loss);
        if -10.0 * best_loss.log10() >= until_db {
            break;
        }
    }
    let phase = Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?;
    let total_s = started.elapsed().as_secs_f64();
    write_npy(options.word("out")?, &phase)?;
    let memory = memory_peak_bytes().map_or_else(|| "null".to_owned(), |bytes| bytes.to_string());
    writeln!(
        std::io::stdout(),
        r#"{{"time_s": {time_s:?}, "loss": {loss:?}, "total_s": {total_s:?}, "memory_peak_bytes": {memory}}}"#
    )?;
    Ok(())
}

fn method(options: &Options) -> Result<HologramMethod, String> {
    match options.text.get("method").map_or("adam", String::as_str) {
        "adam" => Ok(HologramMethod::Adam { learning_rate: options.number("learning-rate", 0.1)? }),
        "lbfgs" => Ok(HologramMethod::Lbfgs),
        other => Err(format!("--method {other} is not a method; methods are adam and lbfgs")),
    }
}

fn initial_phase(options: &Options, method: HologramMethod, detector: Detector) -> Result<InitialPhase, String> {
    let range_rad = options.number("phase-range", RANDOM_RANGE_RAD)?;
    match options.text.get("start").map_or("random", String::as_str) {
        "random" => Ok(InitialPhase::Random { range_rad }),
        "back-propagated" => Ok(InitialPhase::BackPropagated { range_rad }),
        "recommended" => Ok(InitialPhase::recommended(method, detector, 1)),
        other => Err(format!("--start {other} is not a start; starts are random, back-propagated and recommended")),
    }
}

fn write_npy(path: &str, plane: &Plane<f32>) -> Result<(), Box<dyn Error>> {
    let shape = [plane.height_px() as u64, plane.width_px() as u64];
    let file = BufWriter::new(File::create(path).map_err(|error| format!("{path}: {error}"))?);
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(file).begin_nd()?;
    writer.extend(plane.values().iter().copied())?;
    Ok(writer.finish()?)
}

/// Peak memory of the process \[bytes\]. `None`: the system does not report it (only Linux does).
fn memory_peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.split_whitespace().next()?.parse::<u64>().ok()?)
}
