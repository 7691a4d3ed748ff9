//! Memory and time of jobs on a kernel version: its report, and holograms that would improve it.

use super::{KernelSize, LEARNING_FACTOR, Need, PairsSize, REAL, SAMPLED_PAIRS_MAX, STEP_FACTOR, SUGGESTED_ITERATIONS};
use crate::job::SuggestHolograms;
use crate::job::suggest::candidates;
use lightpath_optics::hologram::HologramMethod;
use lightpath_optics::learning::{Block, KernelModel};
use lightpath_optics::memory::{EngineSize, HologramSize, LearningSize};

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
pub fn suggest_holograms(spec: &SuggestHolograms, inputs: &SuggestInputs) -> Need {
    let SuggestInputs { kernel, model, pairs, region_px } = *inputs;
    let (engine, n) = (kernel.engine, kernel.engine.pixels());
    let (order, blocks) = (kernel.order, kernel.blocks);
    // Transfer functions are sampled before.
    let sampled = EngineSize { sampling_bytes: 0, ..engine };
    let size = LearningSize { engine: sampled, model, order, distances: 1, region_px, blocks };
    let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, SUGGESTED_ITERATIONS);
    let running = hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes() + 3 * REAL * n;
    let candidates = candidates(spec.holograms);
    // The files of all candidates are kept: at most two bytes for each pixel.
    let kept = engine.engine_bytes() + size.held_bytes() + u64::from(candidates) * 2 * n;
    let stages = [kernel.reading_bytes(), kept + running.max(size.weighing_bytes() + pairs.reading_bytes(n))];
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
            // What the photographs could hide is among the parameters.
            blocks: kernel.blocks.with(Block::Crosstalk).with(Block::UnevenResponse),
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
