//! Requests: the work that a job must do.

use super::hologram::OptimizeHologram;
use super::prepare::PrepareDataset;
use super::report::ReportKernel;
use super::suggest::SuggestHolograms;
use super::verify::VerifyHologram;
use crate::units::{Distance, Wavelength};
use lightpath_optics::learning::KernelModel;
use lightpath_optics::{Detector, RegionOfInterest};
use serde::{Deserialize, Serialize};
use std::slice;

/// Work that a job must do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobSpec {
    /// Compute holograms that show targets.
    OptimizeHologram(Box<OptimizeHologram>),
    /// Learn kernels from datasets.
    LearnKernel(LearnKernel),
    /// Photograph a hologram on a simulated display.
    SimulateCapture(SimulateCapture),
    /// Measure a kernel on a dataset.
    EvaluateKernel(EvaluateKernel),
    /// Prepare a dataset for learning.
    PrepareDataset(PrepareDataset),
    /// Make the report of a kernel version.
    ReportKernel(ReportKernel),
    /// Judge holograms by an independent model.
    VerifyHologram(VerifyHologram),
    /// Suggest holograms to photograph.
    SuggestHolograms(SuggestHolograms),
}

impl JobSpec {
    /// Words for all kinds of jobs.
    pub const KINDS: [&'static str; 8] = [
        "optimize_hologram",
        "learn_kernel",
        "simulate_capture",
        "evaluate_kernel",
        "prepare_dataset",
        "report_kernel",
        "verify_hologram",
        "suggest_holograms",
    ];

    /// The word for the job's kind, as it is stored.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        let [optimize, learn, simulate, evaluate, prepare, report, verify, suggest] = Self::KINDS;
        match self {
            Self::OptimizeHologram(_) => optimize,
            Self::LearnKernel(_) => learn,
            Self::SimulateCapture(_) => simulate,
            Self::EvaluateKernel(_) => evaluate,
            Self::PrepareDataset(_) => prepare,
            Self::ReportKernel(_) => report,
            Self::VerifyHologram(_) => verify,
            Self::SuggestHolograms(_) => suggest,
        }
    }

    /// Id of the job's display.
    #[must_use]
    pub fn display(&self) -> &str {
        match self {
            Self::OptimizeHologram(spec) => &spec.display,
            Self::LearnKernel(spec) => &spec.display,
            Self::SimulateCapture(spec) => &spec.display,
            Self::EvaluateKernel(spec) => &spec.display,
            Self::PrepareDataset(spec) => &spec.display,
            Self::ReportKernel(spec) => &spec.kernel.display,
            Self::VerifyHologram(spec) => &spec.display,
            Self::SuggestHolograms(spec) => &spec.kernel.display,
        }
    }

    /// Id of the job's dataset. If the job has several datasets, it is the first.
    #[must_use]
    pub fn dataset(&self) -> Option<&str> {
        self.datasets().first().map(String::as_str)
    }

    /// Ids of the job's datasets.
    #[must_use]
    pub fn datasets(&self) -> &[String] {
        match self {
            Self::LearnKernel(spec) => &spec.datasets,
            Self::EvaluateKernel(spec) => slice::from_ref(&spec.dataset),
            Self::PrepareDataset(spec) => slice::from_ref(&spec.dataset),
            Self::OptimizeHologram(_)
            | Self::SimulateCapture(_)
            | Self::ReportKernel(_)
            | Self::VerifyHologram(_)
            | Self::SuggestHolograms(_) => &[],
        }
    }

    /// Kernel versions that the job uses, `None` for the ideal kernel. A hologram job has one for each wavelength and
    /// plane, starting with all planes of the first wavelength.
    #[must_use]
    pub fn kernel_versions(&self) -> Vec<Option<u32>> {
        match self {
            Self::OptimizeHologram(spec) => spec.kernel_versions.concat(),
            Self::EvaluateKernel(spec) => vec![spec.kernel_version],
            Self::LearnKernel(_)
            | Self::SimulateCapture(_)
            | Self::PrepareDataset(_)
            | Self::ReportKernel(_)
            | Self::VerifyHologram(_)
            | Self::SuggestHolograms(_) => Vec::new(),
        }
    }
}

/// Request to learn a kernel from a dataset, or kernels for several distances jointly from several datasets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnKernel {
    /// Ids of the datasets, at least one. They have the same display and wavelength, and different distances.
    pub datasets: Vec<String>,
    /// Id of the datasets' display.
    pub display: String,
    /// Model of the kernel.
    pub model: KernelModel,
    /// Highest polynomial degree of the smooth errors; `None`: the validation pairs decide.
    pub order: Option<u32>,
    /// Version of the first dataset's kernel from which learning starts; `None`: the ideal kernel.
    pub start_version: Option<u32>,
    /// Number of passes over the training pairs; `None`: the model's default.
    pub epochs: Option<u32>,
    /// Learning rate of Adam; `None`: the model's default.
    pub learning_rate: Option<f64>,
    /// Most evaluations of all pairs in the refinement after Adam; `None`: the model's default.
    pub refinement_evaluations: Option<u32>,
    /// Seed of the order in which pairs are used, and of the random start of the `paper` model.
    pub seed: u64,
    /// Rule that defines the light of a camera pixel.
    pub detector: Detector,
    /// Region of the photographs that is compared.
    pub region_of_interest: RegionOfInterest,
}

/// Request to photograph a hologram on a simulated display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateCapture {
    /// Id of the display.
    pub display: String,
    /// Wavelength: one of the display's wavelengths.
    pub wavelength: Wavelength,
    /// Distance from the SLM to the plane of the camera.
    pub distance: Distance,
    /// Artifact digest of the hologram.
    pub phase: String,
    /// Seed of the camera's noise.
    pub seed: u64,
    /// Time since the bench was set up \[s\], for its drift.
    pub elapsed_s: f64,
}

/// Request to measure a kernel on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateKernel {
    /// Id of the dataset.
    pub dataset: String,
    /// Id of the dataset's display.
    pub display: String,
    /// Number of the kernel version; `None`: the ideal kernel.
    pub kernel_version: Option<u32>,
    /// Region of the photographs that is compared.
    pub region_of_interest: RegionOfInterest,
}
