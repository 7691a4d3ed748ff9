//! What jobs are asked to do.

use super::{OptimizeHologram, PrepareDataset, ReportKernel};
use crate::units::{Distance, Wavelength};
use lightpath_optics::learning::KernelModel;
use lightpath_optics::{Detector, RegionOfInterest};
use serde::{Deserialize, Serialize};

/// What to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobSpec {
    /// Find the phase that shows a target.
    OptimizeHologram(Box<OptimizeHologram>),
    /// Learn a kernel from a dataset.
    LearnKernel(LearnKernel),
    /// Photograph a hologram on a simulated display.
    SimulateCapture(SimulateCapture),
    /// Measure a kernel on a dataset.
    EvaluateKernel(EvaluateKernel),
    /// Make a dataset ready to be learned from.
    PrepareDataset(PrepareDataset),
    /// Make the report of a kernel version.
    ReportKernel(ReportKernel),
}

impl JobSpec {
    /// Id of the display that the job is about.
    #[must_use]
    pub fn display(&self) -> &str {
        match self {
            Self::OptimizeHologram(spec) => &spec.display,
            Self::LearnKernel(spec) => &spec.display,
            Self::SimulateCapture(spec) => &spec.display,
            Self::EvaluateKernel(spec) => &spec.display,
            Self::PrepareDataset(spec) => &spec.display,
            Self::ReportKernel(spec) => &spec.kernel.display,
        }
    }

    /// Id of the dataset that the job is about, the first of several.
    #[must_use]
    pub fn dataset(&self) -> Option<&str> {
        match self {
            Self::LearnKernel(spec) => spec.datasets.first().map(String::as_str),
            Self::EvaluateKernel(spec) => Some(&spec.dataset),
            Self::PrepareDataset(spec) => Some(&spec.dataset),
            Self::OptimizeHologram(_) | Self::SimulateCapture(_) | Self::ReportKernel(_) => None,
        }
    }

    /// The kernel versions that the job computes with, `None` for ideal kernels: of a hologram one for each wavelength and
    /// plane, all planes of the first wavelength first.
    #[must_use]
    pub fn kernel_versions(&self) -> Vec<Option<u32>> {
        match self {
            Self::OptimizeHologram(spec) => spec.kernel_versions.concat(),
            Self::EvaluateKernel(spec) => vec![spec.kernel_version],
            Self::LearnKernel(_) | Self::SimulateCapture(_) | Self::PrepareDataset(_) | Self::ReportKernel(_) => {
                Vec::new()
            }
        }
    }
}

/// Learn a kernel from a dataset, or one model of several distances from several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnKernel {
    /// Ids of the datasets, at least one, of one display and wavelength, no two of one distance.
    pub datasets: Vec<String>,
    /// Id of the datasets' display.
    pub display: String,
    /// How the kernel is parametrized.
    pub model: KernelModel,
    /// Highest polynomial degree of the smooth errors; `None`: as the validation pairs choose.
    pub order: Option<u32>,
    /// The version of the first dataset's kernel to start from; `None`: the ideal kernel.
    pub start_version: Option<u32>,
    /// Passes over the training pairs; `None`: the model's default.
    pub epochs: Option<u32>,
    /// Adam's step; `None`: the model's default.
    pub learning_rate: Option<f64>,
    /// Evaluations of all pairs afterwards; `None`: the model's default.
    pub refinement_evaluations: Option<u32>,
    /// Of the order of the pairs, and of the paper model's start.
    pub seed: u64,
    /// What the camera's pixels measure.
    pub detector: Detector,
    /// Where the photographs count.
    pub region_of_interest: RegionOfInterest,
}

/// Photograph a hologram on a simulated display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateCapture {
    /// Id of the display.
    pub display: String,
    /// One of the display's.
    pub wavelength: Wavelength,
    /// From the SLM to the camera's plane.
    pub distance: Distance,
    /// Artifact digest of the hologram.
    pub phase: String,
    /// Of the camera's noise.
    pub seed: u64,
    /// Since the bench was set up \[s\].
    pub elapsed_s: f64,
}

/// Measure a kernel on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateKernel {
    /// Id of the dataset.
    pub dataset: String,
    /// Id of the dataset's display.
    pub display: String,
    /// `None`: the ideal kernel.
    pub kernel_version: Option<u32>,
    /// Where the photographs count.
    pub region_of_interest: RegionOfInterest,
}
