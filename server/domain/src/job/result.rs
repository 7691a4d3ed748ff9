//! What jobs gave.

use super::{HologramResult, PrepareResult, ReportResult};
use crate::dataset::Split;
use crate::kernel::KernelMetrics;
use lightpath_optics::ValidityReport;
use serde::{Deserialize, Serialize};

/// What a job gave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobResult {
    /// Of [`OptimizeHologram`](super::OptimizeHologram).
    Hologram(Box<HologramResult>),
    /// Of [`LearnKernel`](super::LearnKernel).
    Learn(LearnResult),
    /// Of [`SimulateCapture`](super::SimulateCapture).
    Capture(CaptureResult),
    /// Of [`EvaluateKernel`](super::EvaluateKernel).
    Evaluate(EvaluateResult),
    /// Of [`PrepareDataset`](super::PrepareDataset).
    Prepare(PrepareResult),
    /// Of [`ReportKernel`](super::ReportKernel).
    Report(ReportResult),
}

/// Learned kernels, before they have version numbers: the store numbers them in the transaction that ends the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnResult {
    /// One for each dataset, in their order.
    pub kernels: Vec<LearnedKernel>,
    /// Training loss after each epoch and refinement evaluation.
    pub loss_history: Vec<f64>,
    /// The kernels' polynomial degree; 0 for the models paper and dense.
    pub order: u32,
}

/// The kernel of one dataset's distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnedKernel {
    /// Resource name of the new version; filled in by the store.
    pub kernel_version: String,
    /// Id of the dataset.
    pub dataset: String,
    /// How good it is.
    pub metrics: KernelMetrics,
    /// Ids of training pairs whose photographs are not of their holograms.
    pub left_out_pairs: Vec<String>,
    /// How the light's way was computed.
    pub propagation: ValidityReport,
}

/// A simulated photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureResult {
    /// Artifact digest.
    pub photo: String,
    /// How the light's way was computed.
    pub propagation: ValidityReport,
}

/// How well a kernel predicts each pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateResult {
    /// In the order of the pairs' ids.
    pub pairs: Vec<PairLoss>,
    /// How the light's way was computed.
    pub propagation: ValidityReport,
}

/// How well a kernel predicts one pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairLoss {
    /// The pair's id.
    pub pair: String,
    /// What the pair is used for.
    pub split: Split,
    /// In the region of interest, saturated pixels left out, gain and black level fitted.
    pub loss: f64,
    /// The same over the full frame.
    pub loss_full_frame: f64,
}
