//! Results of jobs.

use super::hologram::HologramResult;
use super::prepare::PrepareResult;
use super::report::ReportResult;
use super::suggest::SuggestResult;
use super::verify::VerifyResult;
use crate::dataset::Split;
use crate::kernel::KernelMetrics;
use lightpath_optics::ValidityReport;
use lightpath_optics::learning::{BlockStrengths, StrengthUncertainty};
use serde::{Deserialize, Serialize};

/// Result of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobResult {
    /// Result of [`OptimizeHologram`](super::OptimizeHologram).
    Hologram(Box<HologramResult>),
    /// Result of [`LearnKernel`](super::LearnKernel).
    Learn(LearnResult),
    /// Result of [`SimulateCapture`](super::SimulateCapture).
    Capture(CaptureResult),
    /// Result of [`EvaluateKernel`](super::EvaluateKernel).
    Evaluate(EvaluateResult),
    /// Result of [`PrepareDataset`](super::PrepareDataset).
    Prepare(PrepareResult),
    /// Result of [`ReportKernel`](super::ReportKernel).
    Report(ReportResult),
    /// Result of [`VerifyHologram`](super::VerifyHologram).
    Verify(VerifyResult),
    /// Result of [`SuggestHolograms`](super::SuggestHolograms).
    Suggest(SuggestResult),
}

/// Learned kernels. The store gives them version numbers in the transaction that ends the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnResult {
    /// Kernels: one for each dataset, in the order of the datasets.
    pub kernels: Vec<LearnedKernel>,
    /// Training loss after each epoch and refinement evaluation.
    pub loss_history: Vec<f64>,
    /// Polynomial degree of the kernels; 0 for the models `paper` and `dense`.
    pub order: u32,
    /// Parts of the model that this display needed, with their strengths.
    pub blocks: BlockStrengths,
    /// How certain these strengths are, and what the photographs could hide.
    pub certainty: Box<StrengthUncertainty>,
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

/// Simulated photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureResult {
    /// Artifact digest of the photograph.
    pub photo: String,
    /// Propagation method of the simulation, and its limits.
    pub propagation: ValidityReport,
}

/// Losses of a kernel on the pairs of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateResult {
    /// Losses in the order of the pairs' ids.
    pub pairs: Vec<PairLoss>,
    /// Propagation method of the kernel, and its limits.
    pub propagation: ValidityReport,
}

/// Loss of a kernel on one pair: mean squared error without saturated pixels, with fitted gain and black level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairLoss {
    /// Id of the pair.
    pub pair: String,
    /// Use of the pair.
    pub split: Split,
    /// Loss in the region of interest.
    pub loss: f64,
    /// Loss over the full frame.
    pub loss_full_frame: f64,
}
