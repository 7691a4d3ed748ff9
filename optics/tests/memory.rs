//! The functions of `lightpath_optics::memory` against counted allocations.
//!
//! This test is a binary of its own, because it counts the allocations of the whole process.
#![allow(clippy::unwrap_used)]

use lightpath_optics::hologram::{
    HologramMethod, HologramOptions, ImagePlane, InitialPhase, Loss, ShownLight, initial_phase, pixel_psnr_db,
    with_other_orders,
};
use lightpath_optics::learning::{Blocks, KernelModel, LearnOptions, Learner, LearningPairs, Pair};
use lightpath_optics::memory::{EngineSize, HologramSize, LearningSize};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{
    Crosstalk, Detector, DisplayModel, Dust, Engine, EngineCache, FurtherMode, Ghost, Grid, HologramProblem,
    KernelShape, LightBlur, OpticalSetup, Optimization, OrderFilter, Orders, PartialCoherence, Plane, RegionOfInterest,
    ResponseVariation, SmoothField, SpatialVariation,
};
use num_complex::{Complex32, Complex64};
use peak_alloc::PeakAlloc;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Mutex, PoisonError};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Allocations that no function counts: those of threads, tables and small vectors \[bytes\].
const SMALL_BYTES: u64 = 1_000_000;

/// The wrong estimates of the test that runs. Only one runs at a time, because all allocations of the process are
/// counted.
static WRONG: Mutex<Vec<String>> = Mutex::new(Vec::new());
static ALONE: Mutex<()> = Mutex::new(());

/// Largest number of bytes that `work` allocates at a time.
fn peak_bytes(pool: &ThreadPool, work: impl FnOnce() + Send) -> u64 {
    let before = ALLOCATOR.current_usage();
    ALLOCATOR.reset_peak_usage();
    pool.install(work);
    (ALLOCATOR.peak_usage() - before) as u64
}

/// Remembers an estimate that is below the counted peak, or more than `factor` times as large.
fn check(name: &str, estimate: u64, peak: u64, factor: f64) {
    let ratio = estimate as f64 / peak as f64;
    eprintln!("{name}: {estimate} estimated, {peak} counted, ratio {ratio:.3}");
    if estimate + SMALL_BYTES < peak || ratio > factor {
        WRONG.lock().unwrap().push(format!("{name}: {estimate} bytes estimated, {peak} bytes counted"));
    }
}

fn setup(height_px: usize, width_px: usize, distance_m: f64) -> OpticalSetup {
    OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
}

fn target(height_px: usize, width_px: usize) -> Plane<f32> {
    Plane::from_fn(height_px, width_px, |y, x| if (y / 16 + x / 24) % 2 == 0 { 0.9 } else { 0.2 })
}

fn optimize(size: &HologramSize, initial: &InitialPhase) {
    let EngineSize { height_px, width_px, detector, .. } = size.engine;
    // The engines of a server share their plans and scratch memory.
    let cache = EngineCache::new(0);
    let planes = (0..size.planes).map(|p| {
        let mut model = DisplayModel::ideal(setup(height_px, width_px, 0.01 + 0.01 * p as f64));
        if size.engine.modes > 1 {
            let mode = FurtherMode { light: 1.0, errors: SmoothField::flat(2) };
            model.kernel = KernelShape::Smooth(SmoothField::flat(2));
            model.coherence = PartialCoherence::new(vec![mode; size.engine.modes - 1]);
        }
        let engine = cache.engine(&model, detector, None);
        let weight = size.weighted.then(|| Plane::filled(height_px, width_px, 0.5));
        ImagePlane { engine: engine.unwrap(), target: target(height_px, width_px), weight, share: 1.0 }
    });
    let region = RegionOfInterest::middle(&Grid::try_new(height_px, width_px, 8e-6).unwrap());
    let loss = Loss { total_variation: if size.rough { 0.1 } else { 0.0 }, ..Loss::default() };
    let problem = HologramProblem::with_planes(planes.collect(), size.frames, region, loss).unwrap();
    let phases = initial.phases(&problem, &setup(height_px, width_px, 0.01), 1).unwrap();
    let mut run = Optimization::start(problem, HologramOptions::new(size.method, size.iterations), phases).unwrap();
    while run.step().is_some() {}
}

fn check_hologram(pool: &ThreadPool, size: HologramSize, initial: &InitialPhase) {
    let propagates_back = matches!(initial, InitialPhase::BackPropagated { .. });
    let running = size.problem_bytes() + size.state_bytes() + size.scratch_bytes();
    let estimate = size.planes as u64 * size.engine.engine_bytes() + running.max(size.start_bytes(propagates_back));
    let peak = peak_bytes(pool, || optimize(&size, initial));
    let HologramSize { method, planes, frames, weighted, rough, iterations, .. } = size;
    let detector = size.engine.detector;
    let name = format!(
        "{method:?}, {detector:?}, {planes} planes, {frames} frames, weighted {weighted}, rough {rough}, {iterations} steps"
    );
    check(&name, estimate, peak, 1.2);
}

fn check_quality(pool: &ThreadPool, frames: usize, model: DisplayModel) {
    let setup = model.setup;
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    let size = EngineSize::of(&model, Detector::Pixel, 2);
    let work = || {
        let engine = Engine::new(&model, Detector::Pixel, None).unwrap();
        let phases = vec![initial_phase(height_px, width_px, 1.0, 1).unwrap(); frames];
        let region = RegionOfInterest::middle(&setup.grid());
        for shown in ShownLight::of_sets(&engine, &[&phases, &phases]).unwrap() {
            shown.quality((&target(height_px, width_px), region).into()).unwrap();
        }
    };
    let n = size.pixels() * 4;
    let sampled = size.engine_bytes() + size.sampling_bytes;
    let measured = size.engine_bytes() + (frames as u64 + 1) * n + size.quality_bytes(frames);
    let learned = matches!(model.kernel, KernelShape::Smooth(_));
    let name = format!("quality of {frames} frames, {:?}, learned {learned}", setup.method());
    check(&name, sampled.max(measured), peak_bytes(pool, work), 1.3);
}

fn check_qualities(pool: &ThreadPool) {
    let first = setup(300, 400, 0.01);
    let ideal = DisplayModel::ideal(first.planned().unwrap().0);
    let learned = DisplayModel { kernel: KernelShape::Smooth(SmoothField::flat(3)), ..ideal.clone() };
    check_quality(pool, 1, DisplayModel::ideal(first));
    check_quality(pool, 3, ideal);
    let modes = vec![FurtherMode { light: 1.0, errors: SmoothField::flat(2) }; 2];
    check_quality(pool, 1, DisplayModel { coherence: PartialCoherence::new(modes), ..learned.clone() });
    check_quality(pool, 1, learned.clone());
    let all_orders = DisplayModel::ideal(setup(150, 200, 0.01).with_orders(Orders::SQUARE).unwrap());
    check_quality(pool, 1, all_orders.clone());
    check_quality(pool, 1, DisplayModel { kernel: learned.kernel, ..all_orders });
}

fn check_opinion(pool: &ThreadPool, orders: Orders, flaw: impl Fn(&mut DisplayModel)) {
    let (setup, _) = setup(300, 400, 0.06).with_orders(orders).unwrap().planned().unwrap();
    let mut model = DisplayModel::ideal(setup);
    flaw(&mut model);
    let engine = Engine::new(&model, Detector::Pixel, None).unwrap();
    let phases = [initial_phase(300, 400, 1.0, 1).unwrap()];
    let shown = ShownLight::of_frames(&engine, &phases).unwrap();
    let wanted = (&target(300, 400), RegionOfInterest::middle(&setup.grid()));
    let work = || {
        SecondOpinion::of((&model, None), &phases, &shown, Detector::Pixel, wanted.into(), Effort::CHEAP)
            .unwrap()
            .unwrap();
    };
    let estimate = EngineSize::of(&model, Detector::Pixel, 2).opinion_bytes();
    let (has_bins, varies) = (matches!(model.kernel, KernelShape::Bins(_)), !model.variation.is_none());
    check(
        &format!("second opinion, {orders:?}, bins {has_bins}, varies {varies}"),
        estimate,
        peak_bytes(pool, work),
        1.5,
    );
}

fn check_other_orders(pool: &ThreadPool, orders: Orders) {
    let all_orders = orders.are_all();
    let engine = EngineSize { all_orders, ..EngineSize::ideal(300, 400, Detector::Pixel, 2) };
    let own = DisplayModel::ideal(setup(300, 400, 0.01).with_orders(orders).unwrap());
    let other = with_other_orders(&own).unwrap();
    let work = || {
        let phases = [initial_phase(300, 400, 1.0, 1).unwrap()];
        let region = RegionOfInterest::middle(&other.setup.grid());
        pixel_psnr_db(&EngineCache::new(0), &other, &phases, (&target(300, 400), region).into()).unwrap();
    };
    let estimate = 2 * engine.pixels() * 4 + engine.other_orders_bytes();
    check(&format!("other orders than {orders:?}"), estimate, peak_bytes(pool, work), 1.3);
}

fn check_learning(pool: &ThreadPool, model: KernelModel, distances: usize, orders: Orders) {
    let (height_px, width_px) = (60, 80);
    let region = RegionOfInterest::middle(&Grid::try_new(height_px, width_px, 8e-6).unwrap());
    let at = |i: usize| setup(height_px, width_px, 0.01 + 0.005 * i as f64).with_orders(orders).unwrap();
    let setups: Vec<_> = (0..distances).map(at).collect();
    let engine = EngineSize::ideal(height_px, width_px, Detector::Pixel, 2);
    let engine = if orders.are_all() { engine.sampled_with(&setups[0], false) } else { engine };
    let region_px = [region.height_px(), region.width_px()];
    let size = LearningSize { engine, model, order: 5, distances, region_px, blocks: Blocks::ALL };
    // The estimate is that of a display that needs all blocks. They come from the start, but for the variation of the
    // kernel, which is tried because there are validation pairs. No display has both it and several modes. The
    // photographs are of this display, so that each trial without one of the blocks ends soon.
    let needs_blocks = DisplayModel {
        kernel: KernelShape::Smooth(SmoothField::flat(5)),
        source: SmoothField::flat(10),
        crosstalk: Crosstalk { ratio_x: 0.05, ratio_y: 0.05 },
        // A blur needs most memory with its largest reach.
        light_blur: LightBlur { ratio_x: LightBlur::RATIO_MAX, ratio_y: LightBlur::RATIO_MAX },
        response_variation: ResponseVariation { order: 3, coefficients: vec![0.01; 10] },
        dust: Dust::new(Plane::filled(height_px, width_px, [0, 0])),
        ghost: Ghost { amplitude: Complex64::new(0.1, 0.0), shift_px: [4.0, 3.0], defocus_rad: 1.0 },
        coherence: match model {
            KernelModel::Varying => PartialCoherence::none(),
            _ => PartialCoherence::new(vec![FurtherMode { light: 1.0, errors: SmoothField::flat(2) }; 2]),
        },
        ..DisplayModel::ideal(setups[0])
    };
    let has_slm = matches!(model, KernelModel::Display | KernelModel::Varying);
    let photographs = |setup: &OpticalSetup| match has_slm {
        true => photographed(&DisplayModel { setup: *setup, ..needs_blocks.clone() }),
        false => photographed(&DisplayModel::ideal(*setup)),
    };
    let pairs = Joint(setups.iter().enumerate().map(|(i, setup)| Planes(i, photographs(setup))).collect());
    let work = || {
        let options = LearnOptions {
            warm_start: has_slm.then(|| needs_blocks.clone()),
            epochs: 1,
            degree: Some(5),
            refinement_evaluations: if model.is_smooth() { 2 } else { 0 },
            ..LearnOptions::new(model, region)
        };
        let mut learner = Learner::start_joint(&setups, options, &pairs).unwrap();
        let validated = LearningPairs { training: &pairs, validation: &pairs };
        let learning_pairs = if has_slm { validated } else { LearningPairs::training_only(&pairs) };
        while learner.step(learning_pairs).unwrap().is_some() {}
    };
    // A varying kernel may need the largest grid, but this one needs the smallest. The threads need their memory at the
    // same time in some runs, and one after the other in others.
    let factor = if model == KernelModel::Varying { 3.0 } else { 1.5 };
    let name = format!("{model:?} at {distances} distances, {orders}");
    check(&name, size.fit_bytes(), peak_bytes(pool, work), factor);
}

struct Planes(usize, Vec<Pair>);
struct Joint(Vec<Planes>);

impl lightpath_optics::learning::PairSource for Joint {
    fn len(&self) -> usize {
        self.0.iter().map(|planes| planes.1.len()).sum()
    }

    fn plane(&self, index: usize) -> usize {
        self.0[index / 4].0
    }

    fn pair(&self, index: usize) -> Result<Pair, lightpath_optics::learning::BoxError> {
        Ok(self.0[index / 4].1[index % 4].clone())
    }
}

fn photographed(model: &DisplayModel) -> Vec<Pair> {
    let (height_px, width_px) = (model.setup.grid().height_px(), model.setup.grid().width_px());
    let engine = Engine::new(model, Detector::Pixel, None).unwrap();
    let pair = |seed| {
        let phase = initial_phase(height_px, width_px, 6.0, seed).unwrap();
        let photo = engine.light(&phase).unwrap().map(|light| 0.1 * light);
        Pair { phase, photo }
    };
    (0..4).map(pair).collect()
}

/// Runs the checks alone, and fails if an estimate was wrong.
fn right_estimates(checks: impl FnOnce(&ThreadPool)) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    checks(&pool);
    let wrong = std::mem::take(&mut *WRONG.lock().unwrap());
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn counted_memory_of_holograms_is_that_of_the_functions() {
    right_estimates(|pool| {
        let random = InitialPhase::Random { range_rad: 1.0 };
        let methods = [
            HologramMethod::Adam { learning_rate: 0.1 },
            HologramMethod::Lbfgs,
            HologramMethod::GerchbergSaxton,
            HologramMethod::WeightedGerchbergSaxton,
            HologramMethod::DoublePhase,
        ];
        for method in methods {
            for detector in Detector::ALL {
                let engine = EngineSize::ideal(300, 400, detector, 2);
                check_hologram(pool, HologramSize::new(engine, method, 12), &random);
                let several = HologramSize { planes: 3, frames: 2, ..HologramSize::new(engine, method, 12) };
                check_hologram(pool, several, &random);
            }
            let engine = EngineSize::ideal(300, 400, Detector::Pixel, 2);
            let weighted = HologramSize { planes: 2, weighted: true, ..HologramSize::new(engine, method, 12) };
            check_hologram(pool, weighted, &InitialPhase::BackPropagated { range_rad: 1.0 });
        }
        let engine = EngineSize::ideal(300, 400, Detector::Pixel, 2);
        let partly_coherent = EngineSize { modes: 3, ..engine };
        check_hologram(pool, HologramSize::new(partly_coherent, methods[0], 12), &random);
        check_hologram(pool, HologramSize::new(partly_coherent, methods[1], 12), &random);
        let rough = HologramSize { rough: true, ..HologramSize::new(engine, methods[0], 12) };
        check_hologram(pool, rough, &random);
        check_hologram(pool, HologramSize::new(engine, HologramMethod::Lbfgs, 3), &random);
    });
}

#[test]
fn counted_memory_of_judging_is_that_of_the_functions() {
    right_estimates(|pool| {
        check_qualities(pool);
        let filtered = Orders::Filtered(OrderFilter::rectangle(0.5, 1.0));
        check_quality(pool, 1, DisplayModel::ideal(setup(300, 400, 0.01).with_orders(filtered).unwrap()));
        for orders in [Orders::First, filtered, Orders::SQUARE] {
            check_other_orders(pool, orders);
            check_opinion(pool, orders, |_| ());
        }
        check_opinion(pool, Orders::First, |model| {
            model.kernel = KernelShape::Bins(Plane::filled(600, 800, Complex32::ONE));
        });
        check_opinion(pool, Orders::First, |model| {
            model.kernel = KernelShape::Smooth(SmoothField::flat(3));
            model.variation = SpatialVariation::new(std::array::from_fn(|_| SmoothField::flat(2)));
        });
    });
}

#[test]
fn counted_memory_of_learning_is_that_of_the_functions() {
    right_estimates(|pool| {
        for model in KernelModel::ALL {
            check_learning(pool, model, 1, Orders::First);
        }
        check_learning(pool, KernelModel::Display, 3, Orders::First);
    });
}

#[test]
fn counted_memory_of_learning_all_orders_is_that_of_the_functions() {
    right_estimates(|pool| {
        for (model, distances) in [(KernelModel::Smooth, 1), (KernelModel::Display, 2)] {
            check_learning(pool, model, distances, Orders::SQUARE);
        }
    });
}
