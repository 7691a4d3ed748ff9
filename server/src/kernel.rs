//! Kernels: learned light transport, versioned per display, wavelength and distance.

use crate::units::{Distance, Wavelength};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What a kernel belongs to. Shown as its resource name, `displays/lab-2/kernels/515nm-150mm`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct KernelKey {
    /// Id of the display.
    pub display: String,
    /// Wavelength in vacuum.
    pub wavelength: Wavelength,
    /// From the SLM to the image plane.
    pub distance: Distance,
}

impl fmt::Display for KernelKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "displays/{}/kernels/{}-{}", self.display, self.wavelength, self.distance)
    }
}

/// A kernel: its key and which version is active.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// What it belongs to.
    pub key: KernelKey,
    /// `None`: no version is active.
    pub active_version: Option<u32>,
    /// The newest version; versions count from 1.
    pub latest_version: u32,
    /// \[ms since 1970\]
    pub create_time_ms: i64,
}

/// How a kernel is parametrized.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum KernelModel {
    /// Kavaklı, Ürey, Akşit 2022.
    Paper,
    /// Every frequency bin free.
    Dense,
    /// Smooth amplitude and phase errors.
    Smooth,
    /// Smooth, and source, phase response and zero order.
    Display,
}

/// What a learning job hands to the registry; becomes the kernel's next version.
#[derive(Clone, Debug, PartialEq)]
pub struct NewKernelVersion {
    /// How it is parametrized.
    pub model: KernelModel,
    /// Artifact digest of the safetensors file.
    pub artifact: String,
    /// Size of that file.
    pub size_bytes: u64,
    /// How good it is.
    pub metrics: KernelMetrics,
    /// Where it comes from.
    pub lineage: KernelLineage,
}

/// One immutable kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelVersion {
    /// What it belongs to.
    pub key: KernelKey,
    /// From 1.
    pub version: u32,
    /// Everything else.
    pub content: NewKernelVersion,
    /// \[ms since 1970\]
    pub create_time_ms: i64,
    /// This is the active version.
    pub active: bool,
}

/// Mean squared errors between photograph and prediction: saturated pixels left out, gain and black level fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelMetrics {
    /// Pairs learned from.
    pub train_pairs: u32,
    /// Pairs watched while learning.
    pub validation_pairs: u32,
    /// Pairs held out.
    pub test_pairs: u32,
    /// In the region of interest.
    pub train_loss: f64,
    /// In the region of interest; 0 without validation pairs.
    pub validation_loss: f64,
    /// In the region of interest.
    pub test_loss: f64,
    /// The same pairs through the ideal kernel.
    pub ideal_test_loss: f64,
    /// Over the full frame.
    pub test_loss_full_frame: f64,
    /// Over the full frame, through the ideal kernel.
    pub ideal_test_loss_full_frame: f64,
}

/// Where a version comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelLineage {
    /// Id of the job; empty for an import.
    pub job: String,
    /// Id of the dataset; empty for an import.
    pub dataset: String,
    /// Digest of the dataset.
    pub dataset_digest: String,
    /// The learning parameters as JSON.
    pub parameters_json: String,
    /// Seed of the learning.
    pub seed: u64,
    /// The server's version.
    pub code_version: String,
    /// The version that learning started from; 0: none.
    pub parent_version: u32,
}

/// One move of the alias `active`.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelMove {
    /// Grows over all kernels; what pages are keyed by.
    pub sequence: i64,
    /// \[ms since 1970\]
    pub time_ms: i64,
    /// `None`: none was active.
    pub from_version: Option<u32>,
    /// The version that became active.
    pub to_version: u32,
    /// Why.
    pub reason: String,
    /// The move was a rollback.
    pub rollback: bool,
}
