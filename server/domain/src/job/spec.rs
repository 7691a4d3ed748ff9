//! What jobs are asked to do.

use super::OptimizeHologram;
use crate::kernel::KernelModel;
use crate::units::{Distance, Wavelength};
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
        }
    }

    /// Id of the dataset that the job reads.
    #[must_use]
    pub fn dataset(&self) -> Option<&str> {
        match self {
            Self::LearnKernel(spec) => Some(&spec.dataset),
            Self::EvaluateKernel(spec) => Some(&spec.dataset),
            Self::OptimizeHologram(_) | Self::SimulateCapture(_) => None,
        }
    }
}

/// What counts as a pixel's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Detector {
    /// The intensity at the sample point.
    Point,
    /// The mean over the pixel.
    Pixel,
    /// Every sub-sample by itself.
    Supersampled,
}

/// A rectangle in the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// \[px\]
    pub x_px: u32,
    /// \[px\]
    pub y_px: u32,
    /// \[px\]
    pub width_px: u32,
    /// \[px\]
    pub height_px: u32,
}

/// Learn a kernel from a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnKernel {
    /// Id of the dataset.
    pub dataset: String,
    /// Ids of datasets of the same display and wavelength at other distances, to learn one model of all of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_datasets: Vec<String>,
    /// Id of the dataset's display.
    pub display: String,
    /// How the kernel is parametrized.
    pub model: KernelModel,
    /// Passes over the training pairs; `None`: the model's default.
    pub epochs: Option<u32>,
    /// Evaluations of all pairs afterwards; `None`: the model's default.
    pub refinement_evaluations: Option<u32>,
    /// Adam's step; `None`: the model's default.
    pub learning_rate: Option<f64>,
    /// Of the order of the pairs, and of the paper model's start.
    pub seed: u64,
    /// Highest polynomial degree of the smooth errors; `None`: as the validation pairs choose.
    pub order: Option<u32>,
    /// The version to start from; `None`: the ideal kernel.
    #[serde(default)]
    pub start_version: Option<u32>,
    /// What the camera's pixels measure.
    pub detector: Detector,
    /// Where the photographs count.
    pub region_of_interest: Region,
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
    #[serde(default)]
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
    pub region_of_interest: Region,
}
