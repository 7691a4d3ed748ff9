//! Benchmarks of the engine: each pass of an evaluation, whole evaluations, steps of Adam, evaluations of the default
//! method through learned displays, all metrics of a hologram, and steps of learning.
//!
//! ```sh
//! cargo bench -p lightpath-optics                       # all benchmarks, about ten minutes
//! cargo bench -p lightpath-optics -- 'adam/pixel'       # benchmarks whose names contain this
//! cargo bench -p lightpath-optics -- --test             # each benchmark once, as a test
//! ```
//!
//! Times are per call. `Melem/s` are millions of SLM pixels per second. `examples/cost_per_pixel.rs` prints how the
//! cost of a pixel grows with the size.

#![allow(clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lightpath_bench::TestCard;
use lightpath_optics::engine::passes::{Pass, Passes};
use lightpath_optics::hologram::{HologramMethod, HologramOptions, initial_phase, quality};
use lightpath_optics::learning::{KernelModel, LearnOptions, Learner, LearningPairs, Pair};
use lightpath_optics::{
    Crosstalk, Detector, DisplayModel, Dust, Engine, FurtherMode, Ghost, Grid, HologramProblem, KernelShape, LightBlur,
    OpticalSetup, Optimization, PartialCoherence, Plane, RegionOfInterest, ResponseVariation, SmoothField,
};
use num_complex::Complex64;
use std::time::Duration;

const SIZES: [(&str, usize, usize); 3] = [("540p", 540, 960), ("1080p", 1080, 1920), ("4K", 2160, 3840)];

/// A display of one size, with a target to show.
struct Job {
    setup: OpticalSetup,
    engine: Engine,
    target: Plane<f32>,
    region: RegionOfInterest,
    phase: Plane<f32>,
}

impl Job {
    fn new(height_px: usize, width_px: usize) -> Self {
        let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 0.15).unwrap();
        Self {
            setup,
            engine: Engine::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap(),
            target: TestCard::Portrait.render(height_px, width_px, 1).unwrap(),
            region: RegionOfInterest::middle(&grid),
            phase: initial_phase(height_px, width_px, 1.0, 1).unwrap(),
        }
    }

    fn problem(&self, detector: Detector) -> HologramProblem {
        HologramProblem::new(self.engine.with_detector(detector), self.target.clone(), self.region).unwrap()
    }
}

fn name(detector: Detector) -> &'static str {
    match detector {
        Detector::Point => "point",
        Detector::Pixel => "pixel",
        Detector::Supersampled => "supersampled",
    }
}

fn engine(criterion: &mut Criterion) {
    for (size, height_px, width_px) in SIZES {
        let job = Job::new(height_px, width_px);
        for detector in Detector::ALL {
            passes(criterion, size, &job, detector);
            whole_iterations(criterion, size, &job, detector);
        }
        all_metrics(criterion, size, &job);
    }
}

fn passes(criterion: &mut Criterion, size: &str, job: &Job, detector: Detector) {
    let mut group = criterion.benchmark_group(format!("passes/{}/{size}", name(detector)));
    group.throughput(Throughput::Elements(job.phase.values().len() as u64));
    let engine = job.engine.with_detector(detector);
    let mut passes = Passes::new(engine, job.target.clone(), job.region, job.phase.clone()).unwrap();
    // The passes run in their order: each needs the results of the pass before.
    for pass in Pass::ALL {
        passes.run(pass);
        group.bench_function(pass.name(), |bencher| bencher.iter(|| passes.run(pass)));
    }
    group.finish();
}

fn whole_iterations(criterion: &mut Criterion, size: &str, job: &Job, detector: Detector) {
    let pixels = Throughput::Elements(job.phase.values().len() as u64);
    let mut group = criterion.benchmark_group("evaluate");
    group.throughput(pixels.clone());
    let (mut problem, mut gradient) = (job.problem(detector), job.phase.values().to_vec());
    group.bench_function(BenchmarkId::new(name(detector), size), |bencher| {
        bencher.iter(|| problem.evaluate(job.phase.values(), 1.0, &mut gradient));
    });
    group.finish();
    let mut group = criterion.benchmark_group("adam");
    group.throughput(pixels);
    let options = HologramOptions::new(HologramMethod::Adam { learning_rate: 0.1 }, u32::MAX);
    let mut adam = Optimization::start(problem, options, job.phase.values().to_vec()).unwrap();
    group.bench_function(BenchmarkId::new(name(detector), size), |bencher| bencher.iter(|| adam.step()));
    group.finish();
}

/// Benchmark of an evaluation of the default method, with two detectors, through displays with nothing, with a blur of
/// the light, with every part in one mode of light, and with three modes besides.
fn display_models(criterion: &mut Criterion) {
    for (size, height_px, width_px) in &SIZES[..2] {
        let job = Job::new(*height_px, *width_px);
        let whole = whole_model(job.setup);
        let modes = vec![FurtherMode { light: 1.0, errors: wavy(2) }; 2];
        let partly_coherent = DisplayModel { coherence: PartialCoherence::new(modes), ..whole.clone() };
        let ideal = DisplayModel::ideal(job.setup);
        let blurred = DisplayModel { light_blur: LightBlur::of_sigma_px([0.5, 0.5]), ..ideal.clone() };
        let models = [("ideal", ideal), ("blurred", blurred), ("whole", whole), ("whole-3-modes", partly_coherent)];
        let mut group = criterion.benchmark_group("evaluate_fitted");
        group.throughput(Throughput::Elements(job.phase.values().len() as u64));
        for detector in [Detector::Pixel, Detector::Supersampled] {
            for (model_name, model) in &models {
                let engine = Engine::new(model, detector, None).unwrap();
                let mut problem = HologramProblem::new(engine, job.target.clone(), job.region).unwrap();
                let mut gradient = job.phase.values().to_vec();
                let id = BenchmarkId::new(format!("{}/{model_name}", name(detector)), size);
                group.bench_function(id, |bencher| {
                    bencher.iter(|| problem.evaluate_fitted(job.phase.values(), &mut gradient));
                });
            }
        }
        group.finish();
    }
}

/// A display with every part that a model with one mode of light has, but for a kernel that varies.
fn whole_model(setup: OpticalSetup) -> DisplayModel {
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    DisplayModel {
        kernel: KernelShape::Smooth(wavy(8)),
        ghost: Ghost { amplitude: Complex64::new(0.1, 0.02), shift_px: [9.0, -4.0], defocus_rad: 5.0 },
        source: wavy(10),
        dust: Dust::new(Plane::from_fn(height_px, width_px, |y, x| [(y % 300) as i16, (x % 300) as i16])),
        response: vec![[0.1, -0.05], [0.03, 0.02], [0.01, 0.0]],
        response_variation: ResponseVariation { order: 3, coefficients: vec![0.02; 10] },
        crosstalk: Crosstalk { ratio_x: 0.08, ratio_y: 0.05 },
        light_blur: LightBlur { ratio_x: 0.13, ratio_y: 0.2 },
        zero_order: Complex64::new(0.05, 0.02),
        ..DisplayModel::ideal(setup)
    }
}

fn wavy(order: usize) -> SmoothField {
    let mut field = SmoothField::flat(order);
    let both = field.log_amplitude.iter_mut().chain(&mut field.phase);
    both.enumerate().for_each(|(i, c)| *c = 0.05 * (1.7 * i as f64 + 0.3).sin());
    field
}

/// Benchmark of all metrics, which a job computes once at its end.
fn all_metrics(criterion: &mut Criterion, size: &str, job: &Job) {
    let mut group = criterion.benchmark_group("quality");
    group.throughput(Throughput::Elements(job.phase.values().len() as u64));
    group.bench_function(size, |bencher| {
        bencher.iter(|| quality(&job.engine, &job.phase, &job.target, job.region).unwrap());
    });
    group.finish();
}

/// Benchmark of a learning step with one pair, for the `display` and the `dense` model.
fn learning(criterion: &mut Criterion) {
    for (size, height_px, width_px) in &SIZES[..2] {
        let job = Job::new(*height_px, *width_px);
        // The photograph must fit its hologram and lie mostly within the camera's range: other photographs are refused.
        let photo = job.engine.light(&job.phase).unwrap().map(|light| 0.2 * light);
        let pairs = vec![Pair { phase: job.phase.clone(), photo }];
        let mut group = criterion.benchmark_group("learn");
        group.throughput(Throughput::Elements(job.phase.values().len() as u64));
        for (name, model) in [("display", KernelModel::Display), ("dense", KernelModel::Dense)] {
            let options = LearnOptions { epochs: 1_000_000, degree: Some(5), ..LearnOptions::new(model, job.region) };
            let mut learner = Learner::start(job.setup, options, &pairs).unwrap();
            group.bench_function(BenchmarkId::new(name, size), |bencher| {
                bencher.iter(|| learner.step(LearningPairs::training_only(&pairs)).unwrap().unwrap());
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    targets = engine, display_models, learning
}
criterion_main!(benches);
