//! Memory and time of jobs on datasets: learning, evaluating, aligning and finalizing; and of simulated photographs.

use super::{
    ALIGNMENT_BYTES_MAX, ALIGNMENT_PAIRS_MAX, CAPTURED_ITERATIONS, FILE_STAGES, KernelSize, LEARNING_FACTOR, Need,
    PairsSize, REAL,
};
use crate::job::{AlignBy, LearnKernel, PrepareStep};
use lightpath_optics::SimulatedBench;
use lightpath_optics::hologram::HologramMethod;
use lightpath_optics::learning::{Blocks, KernelModel, LearnOptions};
use lightpath_optics::memory::{EngineSize, HologramSize, LearningSize};

/// What a learning job needs, besides its specification.
#[derive(Clone, Debug, PartialEq)]
pub struct LearningInputs {
    /// Engine of the ideal display, with the job's detector.
    pub engine: EngineSize,
    /// Pairs of each dataset.
    pub pairs: Vec<PairsSize>,
    /// Limit on the memory for transfer functions that are kept for later jobs \[bytes\].
    pub cache_bytes_max: u64,
    /// Bench of a simulated display, with which new holograms are photographed.
    pub bench: Option<SimulatedBench>,
}

/// Need of a learning job.
#[must_use]
pub fn learn_kernel(spec: &LearnKernel, inputs: &LearningInputs) -> Need {
    let (n, datasets) = (inputs.engine.pixels(), inputs.pairs.len());
    let region_px = [spec.region_of_interest.height_px(), spec.region_of_interest.width_px()];
    let order = spec.order.map_or(12, |order| order as usize);
    let (engine, model, blocks) = (inputs.engine, spec.model, Blocks::ALL);
    let size = LearningSize { engine, model, order, distances: datasets, region_px, blocks };
    let kept: Vec<[u64; 3]> = inputs.pairs.iter().map(|pairs| pairs.kept_bytes(n, datasets)).collect();
    let kept_of = |splits: &[usize]| -> u64 { kept.iter().flat_map(|kept| splits.iter().map(|&i| kept[i])).sum() };
    let reading = inputs.pairs.iter().map(|pairs| pairs.reading_bytes(n)).max().unwrap_or(0);
    let checkpoint = if spec.model.is_smooth() { 0 } else { size.state_bytes() };
    let learned = size.engine();
    let kernels = if spec.model.is_smooth() { 0 } else { datasets as u64 * size.kernel_bytes() };
    let compared = learned.fields_bytes() + 5 * REAL * n;
    let own: u64 = inputs.pairs.iter().map(|pairs| pairs.kept_bytes(n, 1).iter().sum()).max().unwrap_or(0);
    // The cache keeps the transfer functions of the ideal and of the learned kernels.
    let transfers = if spec.model.is_smooth() { learned.transfers_bytes() } else { 0 };
    let cached = (datasets as u64 * (transfers + inputs.engine.transfers_bytes())).min(inputs.cache_bytes_max);
    let engine = learned.engine_bytes() + learned.scratch_bytes();
    let measured = kernels + cached.max(engine) + learned.sampling_bytes + own + compared.max(reading);
    let captured = inputs.bench.map_or(0, |bench| {
        let hologram = HologramSize::new(learned, HologramMethod::Lbfgs, CAPTURED_ITERATIONS);
        let running = hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes() + REAL * n;
        kernels
            + cached.max(engine)
            + (running + learned.bench_bytes(&bench))
                .max(learned.simulation_bytes(&bench) + learned.scratch_bytes() + 4 * REAL * n)
    });
    let stages = [
        // An example is made after its pair is read.
        kept_of(&[0, 1]) + size.fit_bytes() + reading.saturating_sub(5 * REAL * n).max(checkpoint),
        measured,
        captured,
        // The kernel, its bytes, and the file.
        4 * kernels,
    ];
    Need::new(stages, learning_work(spec, inputs, &size))
}

fn learning_work(spec: &LearnKernel, inputs: &LearningInputs, size: &LearningSize) -> f64 {
    let defaults = LearnOptions::new(spec.model, spec.region_of_interest);
    let of = |i: usize| inputs.pairs.iter().map(|pairs| pairs.splits[i]).sum::<usize>() as f64;
    let (training, validation, test) = (of(0), of(1), of(2));
    let epochs = f64::from(spec.epochs.unwrap_or(defaults.epochs));
    // Trials of blocks end early, as does the fit of each order.
    let trials = match spec.model {
        KernelModel::Varying => 1.5,
        KernelModel::Display => 0.5,
        _ => 0.0,
    };
    let evaluations =
        (1.0 + trials) * f64::from(spec.refinement_evaluations.unwrap_or(defaults.refinement_evaluations));
    let curvatures = evaluations * inputs.pairs.len() as f64 * training.min(4.0);
    let engine = size.engine();
    let measures = (evaluations + 2.0) * validation + 4.0 * training + 4.0 * test;
    let captured = inputs.bench.map_or(0.0, |bench| {
        let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, CAPTURED_ITERATIONS);
        4.0 * (f64::from(CAPTURED_ITERATIONS) * hologram.step_work() + engine.simulation_work(&bench))
    });
    let learning = (epochs * training + evaluations * training) * size.step_work()
        + curvatures * size.curvature_work()
        + measures * engine.light_work()
        + inputs.pairs.len() as f64 * captured;
    LEARNING_FACTOR * learning + inputs.pairs.len() as f64 * 3.0 * engine.sampling_work as f64
}

/// Need of a job that photographs a hologram on a simulated display.
#[must_use]
pub fn simulate_capture(engine: EngineSize, bench: &SimulatedBench, decoding_bytes: u64) -> Need {
    let n = engine.pixels();
    let stages = [decoding_bytes + 2 * REAL * n, engine.simulation_bytes(bench) + 3 * REAL * n];
    Need::new(stages, 2.0 * engine.simulation_work(bench))
}

/// Need of a job that measures a kernel on a dataset.
#[must_use]
pub fn evaluate_kernel(kernel: &KernelSize, pairs: &PairsSize) -> Need {
    let engine = kernel.engine;
    let n = engine.pixels();
    let kept = pairs.kept_bytes(n, 1).into_iter().max().unwrap_or(0);
    let compared = engine.fields_bytes() + engine.scratch_bytes() + 5 * REAL * n;
    let stages = [
        engine.engine_bytes() + kernel.reading_bytes(),
        engine.engine_bytes() + kernel.numbers_bytes() + kept + compared.max(pairs.reading_bytes(n)),
    ];
    let files = 0.4 * pairs.all as f64 * FILE_STAGES * n as f64;
    Need::new(stages, pairs.all as f64 * 2.4 * engine.light_work() + files + engine.sampling_work as f64)
}

/// What a job that aligns or finalizes a dataset needs, besides its specification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreparingInputs {
    /// Engine of the ideal display.
    pub engine: EngineSize,
    /// Pairs of the dataset.
    pub pairs: PairsSize,
    /// Whether finalizing the dataset aligns it first.
    pub needs_alignment: bool,
    /// Memory for decoding the photograph of the dots \[bytes\].
    pub dots_bytes: u64,
}

/// Need of a job that aligns or finalizes a dataset.
#[must_use]
pub fn prepare_dataset(step: &PrepareStep, inputs: &PreparingInputs) -> Need {
    /// Memory for the correlations of all tiles, and for the spectra of those under way \[bytes\].
    const TILES_BYTES: u64 = 26 << 20;
    let PreparingInputs { engine, pairs, needs_alignment, dots_bytes } = *inputs;
    let n = engine.pixels();
    let by_pairs = match step {
        PrepareStep::Align(by) => matches!(by, AlignBy::Pairs),
        // Pairs that are measured again may then need an alignment.
        PrepareStep::Finalize(options) => !options.keep_alignment && (needs_alignment || pairs.is_stale),
    };
    let by_dots = matches!(step, PrepareStep::Align(AlignBy::Dots { .. }));
    let measures = by_pairs || pairs.is_stale || matches!(step, PrepareStep::Align(_));
    let reconstructor = engine.engine_bytes() + engine.scratch_bytes();
    // Phase, photograph, and its copy on the display's grid; then the reconstruction.
    let reading = pairs.decoding_bytes + 3 * REAL * n;
    let compared = engine.light_bytes().max(TILES_BYTES) + 4 * REAL * n;
    let checked = reconstructor + engine.sampling_bytes.max(reading).max(compared);
    let pair = REAL * (n + pairs.photo_px);
    let together = (ALIGNMENT_BYTES_MAX as u64 / pair).clamp(1, ALIGNMENT_PAIRS_MAX as u64).min(pairs.all as u64);
    let next = reading.max(engine.light_bytes() + REAL * n).max(TILES_BYTES + REAL * n);
    let registered = reconstructor + together * pair + next;
    let stages = [
        if measures { checked } else { 0 },
        if by_pairs { registered } else { 0 },
        // A photograph of dots is blurred several times.
        if by_dots { 4 * dots_bytes + 2 * REAL * n } else { 0 },
    ];
    let lights = if measures { 2 * pairs.all } else { 0 } + if by_pairs { 6 * ALIGNMENT_PAIRS_MAX } else { 0 };
    let sampling = if measures || by_pairs { engine.sampling_work as f64 } else { 0.0 };
    Need::new(stages, 3.0 * lights as f64 * engine.light_work() + sampling)
}
