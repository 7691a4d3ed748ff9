//! Estimates of the memory and the time of jobs, made before they start.
//!
//! Each kind of job runs in stages. An estimate is the largest sum of the memory that is held at once. The engine
//! counts its own buffers (`lightpath_optics::memory`), and the reading of pictures is counted where they are decoded.
//! The work of a job has the unit of the engine, values times radix-2 stages. The speed of the machine turns it into a
//! time.
//!
//! An estimate must not be below the real memory, and should be at most half as much again. `docs/estimates.md`
//! compares estimates with measurements.

#[cfg(test)]
mod tests;

use super::{AlignBy, OptimizeHologram, PrepareStep};
use crate::dataset::{Dataset, Split};
use crate::display::Display;
use lightpath_optics::hologram::{HologramMethod, InitialPhase};
use lightpath_optics::learning::{Blocks, KernelModel, LearnOptions};
use lightpath_optics::memory::{EngineSize, HologramSize, LearningSize};
use lightpath_optics::second_opinion::Effort;
use lightpath_optics::{Detector, SimulatedBench};
use serde::{Deserialize, Serialize};

/// Limit on the memory for the decoded training pairs of one job \[bytes\]. Reading a pair again takes about as long as
/// learning from it, but a large dataset must not fill the machine's memory.
pub const TRAINING_PAIRS_BYTES_MAX: usize = 256 << 20;
/// The same limit for validation pairs and for test pairs, which are used less often \[bytes\].
pub const OTHER_PAIRS_BYTES_MAX: usize = 64 << 20;
/// Limit on the memory for the pictures of the pairs from which an alignment is computed \[bytes\].
pub const ALIGNMENT_BYTES_MAX: usize = 384 << 20;
/// Limit on the number of these pairs.
pub const ALIGNMENT_PAIRS_MAX: usize = 8;
/// Number of L-BFGS steps for each hologram with which a learned kernel of a simulated display is photographed. The
/// result is within one or two decibels of convergence.
pub const CAPTURED_ITERATIONS: u32 = 40;

/// Number of L-BFGS steps for each hologram from which the suggested ones are chosen: enough for a recognizable
/// picture.
pub const SUGGESTED_ITERATIONS: u32 = 15;
/// Limit on the number of photographed holograms whose information is computed. It is taken for that of all.
pub const SAMPLED_PAIRS_MAX: usize = 8;

/// Memory that every job takes: stacks of its threads, rows of the database, tables, and what the allocator keeps
/// \[bytes\].
const BASE_BYTES: u64 = 12 << 20;
/// Part of the memory in smaller allocations that the allocator keeps for itself after they are freed.
const FRAGMENTATION: f64 = 0.03;
/// Bytes of a real number in f32.
const REAL: u64 = 4;
/// Time of reading or writing a pixel of a picture: codec, digest and disk, in the unit of work.
const FILE_STAGES: f64 = 1500.0;
/// Time of a step, relative to that on a small display, whose buffers fit into the caches. The speed is measured on
/// such a display.
const STEP_FACTOR: f64 = 1.2;
/// Time of learning, relative to that of its propagations and products.
const LEARNING_FACTOR: f64 = 1.5;
/// Memory of the tables for many rows in a thorough opinion, for each frequency along y \[bytes\].
const THOROUGH_BYTES_PER_VALUE_ALONG_Y: u64 = 128 * 4 * 16;
/// Work of a job besides what is counted: its start, its rows in the database, its files.
const BASE_WORK: f64 = 5e8;

/// Estimate of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Largest memory at a time, above that of the idle server \[bytes\]; 0: not estimated.
    pub memory_bytes: u64,
    /// Time of an attempt that no other job slows down \[s\]; 0: not estimated.
    pub time_s: f64,
}

/// Memory and work of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Need {
    /// Largest memory at a time \[bytes\].
    pub memory_bytes: u64,
    /// Work, in values times radix-2 stages.
    pub work: f64,
}

impl Need {
    fn new(stages: impl IntoIterator<Item = u64>, work: f64) -> Self {
        let largest = stages.into_iter().max().unwrap_or(0);
        let memory_bytes = BASE_BYTES + largest + (FRAGMENTATION * largest as f64) as u64;
        Self { memory_bytes, work: BASE_WORK + work }
    }

    /// The estimate for a machine that does `work_per_s` work each second.
    #[must_use]
    pub fn on(self, work_per_s: f64) -> Estimate {
        Estimate { memory_bytes: self.memory_bytes, time_s: self.work / work_per_s }
    }
}

/// A kernel that a job uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelSize {
    /// Engine with the kernel.
    pub engine: EngineSize,
    /// Highest order of a smooth kernel; 0 for other kernels.
    pub order: usize,
    /// Blocks of the kernel's model.
    pub blocks: Blocks,
    /// Whether the kernel has a value for each frequency.
    pub has_bins: bool,
    /// Size of the kernel's file \[bytes\]; 0: the ideal kernel.
    pub file_bytes: u64,
}

impl KernelSize {
    /// Memory for reading the kernel and sampling its transfer functions, besides them: the file, its numbers, and
    /// their copy.
    fn reading_bytes(&self) -> u64 {
        3 * self.numbers_bytes() + self.engine.sampling_bytes
    }

    /// Numbers of a kernel with a value for each frequency.
    fn numbers_bytes(&self) -> u64 {
        if self.has_bins { self.file_bytes } else { 0 }
    }

    /// Transfer functions that the engine's cache may keep.
    fn cached_bytes(&self) -> u64 {
        if self.has_bins { 0 } else { self.engine.transfers_bytes() }
    }
}

/// What a hologram job needs, besides its specification.
#[derive(Clone, Debug, PartialEq)]
pub struct HologramInputs {
    /// Limit on the memory for transfer functions that are kept for later jobs \[bytes\].
    pub cache_bytes_max: u64,
    /// Kernels: for each wavelength one for each plane.
    pub kernels: Vec<Vec<KernelSize>>,
    /// Largest memory for decoding one of its pictures \[bytes\].
    pub decoding_bytes: u64,
}

/// Need of a hologram job.
#[must_use]
pub fn optimize_hologram(spec: &OptimizeHologram, inputs: &HologramInputs) -> Need {
    let transfers = |kernels: &[KernelSize]| kernels.iter().map(KernelSize::cached_bytes).sum::<u64>();
    let all: u64 = inputs.kernels.iter().map(|kernels| transfers(kernels)).sum();
    let each = inputs.kernels.iter().map(|kernels| {
        let (stage, work) = one_wavelength(spec, kernels, inputs.decoding_bytes);
        // The cache keeps the transfer functions of the other wavelengths.
        (stage + (all - transfers(kernels)).min(inputs.cache_bytes_max), work)
    });
    let (stages, work): (Vec<u64>, Vec<f64>) = each.unzip();
    Need::new(stages, work.iter().sum())
}

/// Largest memory and work of the hologram of one wavelength.
fn one_wavelength(spec: &OptimizeHologram, kernels: &[KernelSize], decoding_bytes: u64) -> (u64, f64) {
    let Some(first) = kernels.first() else { return (0, 0.0) };
    let engine = widest(kernels).with_detector(spec.detector);
    let size = HologramSize {
        planes: spec.planes.len(),
        frames: spec.frames as usize,
        weighted: spec.weight_mask.is_some() || spec.depth_map.is_some(),
        rough: spec.loss.total_variation > 0.0 || spec.loss.speckle > 0.0,
        levels: spec.quantization_aware,
        ..HologramSize::new(engine, spec.method, spec.iterations)
    };
    let n = first.engine.pixels();
    let (phases, picture) = (size.phases_bytes(), REAL * n);
    let engines: u64 = kernels.iter().map(|kernel| kernel.engine.engine_bytes()).sum();
    let setup = engines + size.pictures_bytes();
    let reading = kernels.iter().map(KernelSize::reading_bytes).max().unwrap_or(0);
    let masks = if size.weighted { 2 * picture } else { 0 };
    let given = matches!(spec.initial_phase, InitialPhase::Given(_));
    let propagates_back = matches!(spec.initial_phase, InitialPhase::BackPropagated { .. });
    // Given phases are read from a file into a plane.
    let started = setup + size.start_bytes(propagates_back) + if given { 2 * phases } else { 0 };
    let running = setup + size.problem_bytes() + size.state_bytes() + size.scratch_bytes();
    // The results: the wrapped and the displayed phases, the latter twice, a copy, and one of them as levels and files.
    let results = 4 * phases + 3 * picture;
    let stages = [
        setup + masks + decoding_bytes.max(reading),
        started,
        running + size.state_bytes().max(results),
        setup + 3 * phases + 2 * picture + judging_bytes(&engine, size.frames).max(engine.other_orders_bytes()),
    ];
    let steps = if spec.method == HologramMethod::DoublePhase { 1 } else { spec.iterations };
    let files = (size.planes + 3 * size.frames) as f64 * FILE_STAGES * n as f64;
    let other_orders = size.planes as f64 * engine.other_orders_work(size.frames);
    let sampling: u64 = kernels.iter().map(|kernel| kernel.engine.sampling_work).sum();
    let judging = |kernel: &KernelSize| {
        let opinion = kernel.engine.opinion_work(size.frames, Effort::CHEAP.rows_max, &[spec.detector]);
        kernel.engine.quality_work(size.frames) + opinion
    };
    let judging: f64 = kernels.iter().map(judging).sum();
    let besides = judging + files + other_orders + sampling as f64;
    let work = f64::from(steps) * STEP_FACTOR * size.step_work() + besides;
    (stages.into_iter().max().unwrap_or(0), work)
}

/// Memory for measuring the quality of a hologram, and for the second opinion on it.
fn judging_bytes(engine: &EngineSize, frames: usize) -> u64 {
    let light = 6 * REAL * engine.pixels();
    engine.quality_bytes(frames).max(light + engine.opinion_bytes())
}

/// Need of a job that judges the holograms of another job.
#[must_use]
pub fn verify_hologram(verified: &OptimizeHologram, kernels: &[Vec<KernelSize>]) -> Need {
    let frames = verified.frames as usize;
    let each = kernels.iter().map(|kernels| {
        let (engine, n) = (widest(kernels), kernels[0].engine.pixels());
        let engines: u64 = kernels.iter().map(|kernel| kernel.engine.engine_bytes()).sum();
        let reading = kernels.iter().map(KernelSize::reading_bytes).max().unwrap_or(0);
        let pictures = (frames + kernels.len()) as u64 * REAL * n;
        let thorough = THOROUGH_BYTES_PER_VALUE_ALONG_Y * engine.opinion_values.isqrt();
        let memory = engines + pictures + reading.max(judging_bytes(&engine, frames) + thorough);
        let work = kernels.iter().map(|kernel| {
            let opinions = kernel.engine.opinion_work(frames, Effort::THOROUGH.rows_max, &Detector::ALL);
            opinions + kernel.engine.quality_work(frames) + 2.0 * kernel.engine.sampling_work as f64
        });
        (memory, work.sum::<f64>())
    });
    let (stages, work): (Vec<u64>, Vec<f64>) = each.unzip();
    Need::new(stages, work.iter().sum())
}

/// An engine as large as the largest of the kernels.
fn widest(kernels: &[KernelSize]) -> EngineSize {
    let first = kernels[0].engine;
    kernels.iter().fold(first, |widest, kernel| EngineSize {
        kernels_per_side: widest.kernels_per_side.max(kernel.engine.kernels_per_side),
        has_source: widest.has_source || kernel.engine.has_source,
        wraps_phase: widest.wraps_phase || kernel.engine.wraps_phase,
        ..widest
    })
}

/// The pairs of a dataset, as far as they determine memory and work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairsSize {
    /// Numbers of pairs for training, validation and test.
    pub splits: [usize; 3],
    /// Number of all pairs.
    pub all: usize,
    /// Whether a pair was not measured with the present alignment.
    pub is_stale: bool,
    /// Largest number of pixels of a photograph.
    pub photo_px: u64,
    /// Largest memory for decoding one photograph \[bytes\].
    pub decoding_bytes: u64,
}

impl PairsSize {
    /// Memory for decoding one pixel of a photograph: file, samples, and light before and after its orientation.
    const DECODING_BYTES_PER_PX: u64 = 10;

    /// Size of a dataset's pairs. Photographs whose size is not known have that of the display.
    #[must_use]
    pub fn of(dataset: &Dataset, display: &Display) -> Self {
        let used = |split| dataset.pairs.iter().filter(|pair| pair.split == Some(split)).count();
        let px = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let measured = dataset.pairs.iter().filter_map(|pair| pair.checks.as_ref()).map(|checks| px(checks.photo_px));
        let aligned = dataset.alignment.as_ref().map(|found| px([found.photo_width_px, found.photo_height_px]));
        let own = px([display.width_px, display.height_px]);
        let photo_px = measured.chain(aligned).max().unwrap_or(0).max(own);
        Self {
            splits: [Split::Train, Split::Validation, Split::Test].map(used),
            all: dataset.pairs.len(),
            is_stale: dataset.pairs.iter().any(|pair| !pair.is_measured_with(dataset.homography())),
            photo_px,
            decoding_bytes: Self::DECODING_BYTES_PER_PX * photo_px,
        }
    }

    /// Memory of the decoded pairs that are kept, for training, validation and test.
    fn kept_bytes(&self, pixels: u64, datasets: usize) -> [u64; 3] {
        let limits = [TRAINING_PAIRS_BYTES_MAX, OTHER_PAIRS_BYTES_MAX, OTHER_PAIRS_BYTES_MAX];
        let pair = 2 * REAL * pixels;
        std::array::from_fn(|i| {
            let room = (limits[i] / datasets) as u64 / pair;
            room.min(self.splits[i] as u64) * pair
        })
    }

    /// Memory for reading a pair: the files, the decoded photograph, and the planes on the display's grid.
    fn reading_bytes(&self, pixels: u64) -> u64 {
        self.decoding_bytes + 4 * REAL * pixels
    }
}

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
pub fn learn_kernel(spec: &super::LearnKernel, inputs: &LearningInputs) -> Need {
    let (n, datasets) = (inputs.engine.pixels(), inputs.pairs.len());
    let region_px = [spec.region_of_interest.height_px(), spec.region_of_interest.width_px()];
    let order = spec.order.map_or(12, |order| order as usize);
    let modes = LearningSize::MODES_MAX;
    let (engine, model, blocks) = (inputs.engine, spec.model, Blocks::ALL);
    let size = LearningSize { engine, model, order, distances: datasets, region_px, modes, blocks };
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

fn learning_work(spec: &super::LearnKernel, inputs: &LearningInputs, size: &LearningSize) -> f64 {
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

/// What a job needs that suggests holograms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuggestInputs {
    /// Kernel of the version.
    pub kernel: KernelSize,
    /// Model of the version.
    pub model: KernelModel,
    /// Pairs of its dataset.
    pub pairs: PairsSize,
    /// Rows and columns of the region that is compared \[px\].
    pub region_px: [usize; 2],
}

/// Need of a job that suggests holograms.
#[must_use]
pub fn suggest_holograms(spec: &super::SuggestHolograms, inputs: &SuggestInputs) -> Need {
    let SuggestInputs { kernel, model, pairs, region_px } = *inputs;
    let (engine, n) = (kernel.engine, kernel.engine.pixels());
    let (order, modes, blocks) = (kernel.order, engine.modes, kernel.blocks);
    // Transfer functions are sampled before.
    let sampled = EngineSize { sampling_bytes: 0, ..engine };
    let size = LearningSize { engine: sampled, model, order, distances: 1, region_px, modes, blocks };
    let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, SUGGESTED_ITERATIONS);
    let running = hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes() + 3 * REAL * n;
    let candidates = super::suggest::candidates(spec.holograms);
    // While a hologram is optimized, no curvature is computed: its rows are counted apart.
    let between = LearningSize { region_px: [1, 1], ..size }.weighed_bytes();
    let weighing = size.weighed_bytes() - between + pairs.reading_bytes(n);
    // The files of all candidates are kept: at most two bytes for each pixel.
    let kept = engine.engine_bytes() + between + u64::from(candidates) * 2 * n;
    let stages = [kernel.reading_bytes(), kept + running.max(weighing)];
    let steps = f64::from(candidates * SUGGESTED_ITERATIONS) * STEP_FACTOR * hologram.step_work();
    let curvatures = f64::from(candidates) + (SAMPLED_PAIRS_MAX as f64).min(pairs.splits[0] as f64);
    let work = steps + LEARNING_FACTOR * curvatures * size.curvature_work() + 2.0 * engine.sampling_work as f64;
    Need::new(stages, work)
}

/// What the report of a kernel version needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportInputs {
    /// Kernel of the version.
    pub kernel: KernelSize,
    /// Model of the version.
    pub model: KernelModel,
    /// Size of the largest file of another version \[bytes\].
    pub other_file_bytes: u64,
    /// Size of the files of all versions that it shows \[bytes\].
    pub other_files_bytes: u64,
    /// Pairs of its dataset; `None`: it has none.
    pub pairs: Option<PairsSize>,
    /// Rows and columns of the region that is compared \[px\].
    pub region_px: [usize; 2],
}

/// Need of a report.
#[must_use]
pub fn report_kernel(inputs: &ReportInputs) -> Need {
    /// Memory for the spectrum of a hologram in f64 and its transposed copies, for each pixel \[bytes\].
    const SPECTRUM_BYTES_PER_PX: u64 = 68;
    /// Memory for charts, pictures and point spread functions \[bytes\].
    const DRAWING_BYTES: u64 = 120 << 20;
    /// Work of drawing and writing the page.
    const DRAWING_WORK: f64 = 8e9;
    /// Work of reading a byte of another version, and of its pictures.
    const OTHER_STAGES: f64 = 85.0;
    let kernel = inputs.kernel;
    let (engine, n) = (kernel.engine, kernel.engine.pixels());
    // The version's own numbers stay, those of one other version come and go.
    let numbers = kernel.numbers_bytes();
    let others = numbers + 3 * inputs.other_file_bytes;
    let drawn = numbers + inputs.other_file_bytes + engine.sampled_bytes() + engine.sampling_bytes.max(DRAWING_BYTES);
    let compared = inputs.pairs.map_or(0, |pairs| {
        let size = LearningSize {
            // The ideal kernel was sampled before.
            engine: EngineSize {
                kernels_per_side: 1,
                has_source: false,
                wraps_phase: false,
                sampling_bytes: 0,
                ..engine
            },
            model: inputs.model,
            order: kernel.order,
            distances: 1,
            region_px: inputs.region_px,
            modes: engine.modes,
            blocks: Blocks::ALL,
        };
        let fit =
            if matches!(inputs.model, KernelModel::Display | KernelModel::Varying) { size.fit_bytes() } else { 0 };
        let compared = engine.fields_bytes() + 8 * REAL * n;
        let pair = compared.max(SPECTRUM_BYTES_PER_PX * n) + pairs.reading_bytes(n) + 2 * REAL * n;
        // A kernel with a value for each frequency does not sample the ideal one.
        let reading = if kernel.has_bins { 3 * numbers } else { kernel.reading_bytes() };
        numbers + engine.engine_bytes() + engine.scratch_bytes() + fit + pair.max(reading)
    });
    let pairs = inputs.pairs.map_or(0.0, |pairs| (pairs.all as f64).min(32.0));
    let lights = if inputs.model.is_smooth() { 26.0 } else { 8.0 };
    let work = pairs * lights * engine.light_work() + OTHER_STAGES * inputs.other_files_bytes as f64 + DRAWING_WORK;
    Need::new([others, drawn, compared], work)
}
