//! Memory and time of jobs that optimize or judge holograms.

use super::{FILE_STAGES, KernelSize, Need, REAL, STEP_FACTOR};
use crate::job::OptimizeHologram;
use lightpath_optics::Detector;
use lightpath_optics::hologram::{HologramMethod, InitialPhase};
use lightpath_optics::memory::{EngineSize, HologramSize};
use lightpath_optics::second_opinion::Effort;

/// Memory of the tables for many rows in a thorough opinion on light that does not blur, for each frequency along y
/// \[bytes\].
const THOROUGH_BYTES_PER_VALUE_ALONG_Y: u64 = 128 * 4 * 16;

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
        let thorough = THOROUGH_BYTES_PER_VALUE_ALONG_Y
            * engine.opinion.map_or(0, |opinion| opinion.along_axis * opinion.rows_for_each);
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
        blurs_light: widest.blurs_light || kernel.engine.blurs_light,
        ..widest
    })
}
