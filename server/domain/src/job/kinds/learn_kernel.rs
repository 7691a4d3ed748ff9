//! Learning jobs: request, result, memory and time.

use super::Kind;
use crate::job::estimate::{CAPTURED_ITERATIONS, LEARNING_FACTOR, Need, PairsSize, REAL};
use crate::kernel::{KernelKey, KernelMetrics};
use crate::lineage::LearningParameters;
use lightpath_bench::{BenchSize, SimulatedBench};
use lightpath_optics::ValidityReport;
use lightpath_optics::hologram::HologramMethod;
use lightpath_optics::learning::{Blocks, KernelModel, LearnOptions, PartStrength};
use lightpath_optics::memory::{EngineSize, HologramSize, LearningSize};
use serde::{Deserialize, Serialize};

/// Request to learn a kernel from a dataset, or kernels for several distances jointly from several datasets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnKernel {
    /// Ids of the datasets, at least one. They have the same display and wavelength, and different distances.
    pub datasets: Vec<String>,
    /// Id of the datasets' display.
    pub display: String,
    /// Version of the first dataset's kernel from which learning starts; `None`: the ideal kernel.
    pub start_version: Option<(KernelKey, u32)>,
    /// What else is asked of the learning.
    pub parameters: LearningParameters,
}

/// Learned kernels. The store gives them version numbers in the transaction that ends the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnResult {
    /// Kernels: one for each dataset, in the order of the datasets.
    pub kernels: Vec<LearnedKernel>,
    /// Training loss after each epoch and refinement evaluation.
    pub loss_history: Vec<f64>,
    /// Polynomial degree of the kernels; 0 for the models `paper` and `dense`.
    #[serde(rename = "order")]
    pub degree: u32,
    /// The parts of the model that only some displays need: which this one needed, how strong they are, how certain that
    /// is, and what the photographs could hide.
    #[serde(default)]
    pub parts: Vec<PartStrength>,
}

/// Kernel learned for the distance of one dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnedKernel {
    /// Resource name of the new version, filled in by the store.
    pub kernel_version: String,
    /// Id of the dataset.
    pub dataset: String,
    /// Losses of the kernel on the pairs.
    pub metrics: KernelMetrics,
    /// Ids of training pairs that learning left out because their photographs do not show their holograms.
    pub left_out_pairs: Vec<String>,
    /// Propagation method of the kernel, and its limits.
    pub propagation: ValidityReport,
}

impl Kind for LearnKernel {
    fn display(&self) -> &str {
        &self.display
    }

    fn datasets(&self) -> &[String] {
        &self.datasets
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
pub fn need(spec: &LearnKernel, inputs: &LearningInputs) -> Need {
    let (n, datasets) = (inputs.engine.pixels(), inputs.pairs.len());
    let region_px = [spec.parameters.region_of_interest.height_px(), spec.parameters.region_of_interest.width_px()];
    let degree = spec.parameters.degree.map_or(12, |degree| degree as usize);
    let (engine, model, blocks) = (inputs.engine, spec.parameters.model, Blocks::ALL);
    let size = LearningSize { engine, model, order: degree, distances: datasets, region_px, blocks };
    let kept: Vec<[u64; 3]> = inputs.pairs.iter().map(|pairs| pairs.kept_bytes(n, datasets)).collect();
    let kept_of = |splits: &[usize]| -> u64 { kept.iter().flat_map(|kept| splits.iter().map(|&i| kept[i])).sum() };
    let reading = inputs.pairs.iter().map(|pairs| pairs.reading_bytes(n)).max().unwrap_or(0);
    let checkpoint = if spec.parameters.model.is_smooth() { 0 } else { size.state_bytes() };
    let learned = size.engine();
    let kernels = if spec.parameters.model.is_smooth() { 0 } else { datasets as u64 * size.kernel_bytes() };
    let compared = learned.fields_bytes() + 5 * REAL * n;
    let own: u64 = inputs.pairs.iter().map(|pairs| pairs.kept_bytes(n, 1).iter().sum()).max().unwrap_or(0);
    // The cache keeps the transfer functions of the ideal and of the learned kernels.
    let transfers = if spec.parameters.model.is_smooth() { learned.transfers_bytes() } else { 0 };
    let cached = (datasets as u64 * (transfers + inputs.engine.transfers_bytes())).min(inputs.cache_bytes_max);
    let engine = learned.engine_bytes() + learned.scratch_bytes();
    let measured = kernels + cached.max(engine) + learned.sampling_bytes + own + compared.max(reading);
    let captured = inputs.bench.map_or(0, |bench| {
        let hologram = HologramSize::new(learned, HologramMethod::Lbfgs, CAPTURED_ITERATIONS);
        let running = hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes() + REAL * n;
        let size = BenchSize::new(learned, bench);
        kernels
            + cached.max(engine)
            + (running + size.bench_bytes()).max(size.simulation_bytes() + learned.scratch_bytes() + 4 * REAL * n)
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
    let defaults = LearnOptions::new(spec.parameters.model, spec.parameters.region_of_interest);
    let of = |i: usize| inputs.pairs.iter().map(|pairs| pairs.splits[i]).sum::<usize>() as f64;
    let (training, validation, test) = (of(0), of(1), of(2));
    let epochs = f64::from(spec.parameters.epochs.unwrap_or(defaults.epochs));
    // Trials of blocks end early, as does the fit of each order.
    let trials = match spec.parameters.model {
        KernelModel::Varying => 1.5,
        KernelModel::Display => 0.5,
        _ => 0.0,
    };
    let evaluations =
        (1.0 + trials) * f64::from(spec.parameters.refinement_evaluations.unwrap_or(defaults.refinement_evaluations));
    let curvatures = evaluations * inputs.pairs.len() as f64 * training.min(4.0);
    let engine = size.engine();
    let measures = (evaluations + 2.0) * validation + 4.0 * training + 4.0 * test;
    let captured = inputs.bench.map_or(0.0, |bench| {
        let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, CAPTURED_ITERATIONS);
        let photograph = BenchSize::new(engine, bench).simulation_work();
        4.0 * (f64::from(CAPTURED_ITERATIONS) * hologram.step_work() + photograph)
    });
    let learning = (epochs * training + evaluations * training) * size.step_work()
        + curvatures * size.curvature_work()
        + measures * engine.light_work()
        + inputs.pairs.len() as f64 * captured;
    LEARNING_FACTOR * learning + inputs.pairs.len() as f64 * 3.0 * engine.sampling_work as f64
}
