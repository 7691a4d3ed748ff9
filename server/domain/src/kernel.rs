//! Kernels: learned light transport, versioned per display, wavelength and distance.

pub use lightpath_optics::KernelModel;

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
    /// The active version, or the newest where none is active, was [interpolated](KernelLineage::interpolated).
    pub interpolated: bool,
    /// \[ms since 1970\]
    pub create_time_ms: i64,
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
    /// Of new holograms; only of simulated displays.
    pub captured: Option<CapturedQuality>,
}

/// What the camera of a simulated display sees of new holograms, the mean over some targets \[dB\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapturedQuality {
    /// PSNR through the kernel.
    pub psnr_db: f64,
    /// PSNR through the ideal kernel.
    pub ideal_psnr_db: f64,
}

impl KernelMetrics {
    /// Measured, and not shown to be better than the ideal kernel: neither in predicting held-out photographs, nor, where
    /// that was tried, in photographs of new holograms.
    #[must_use]
    pub fn no_better_than_ideal(&self) -> bool {
        // Losses that are not numbers show nothing.
        let predicts = self.test_loss < self.ideal_test_loss;
        let shows = self.captured.is_none_or(|captured| captured.psnr_db > captured.ideal_psnr_db);
        (self.test_pairs > 0 && !predicts) || !shows
    }
}

/// Where a version comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelLineage {
    /// Id of the job; empty for an import.
    pub job: String,
    /// What the version was learned from: at its own distance, then, where one model was learned for several distances, at the
    /// others, ascending. Of an interpolated version all of them, ascending. Empty for other imports.
    pub datasets: Vec<LearnedDataset>,
    /// No photograph of the kernel's distance was learned from: it lies between those of `datasets`.
    pub interpolated: bool,
    /// The version that learning started from; `None`: the ideal kernel.
    pub parent_version: Option<u32>,
    /// The learning parameters as JSON.
    pub parameters_json: String,
    /// Seed of the learning.
    pub seed: u64,
    /// The server's version.
    pub code_version: String,
}

impl KernelLineage {
    /// What was learned from at the version's own distance; `None` for imports, and where there was no photograph.
    #[must_use]
    pub fn own_dataset(&self) -> Option<&LearnedDataset> {
        self.datasets.first().filter(|_| !self.interpolated)
    }

    /// The distances that one model was learned for, ascending, where they are several.
    #[must_use]
    pub fn joint_distances(&self) -> Option<Vec<Distance>> {
        let is_joint = self.interpolated || self.datasets.len() > 1;
        is_joint.then(|| {
            let mut distances: Vec<Distance> = self.datasets.iter().map(|dataset| dataset.distance).collect();
            distances.sort_unstable();
            distances
        })
    }
}

/// A dataset that a version was learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LearnedDataset {
    /// From the SLM to the camera's plane.
    pub distance: Distance,
    /// Id of the dataset; empty for an import.
    pub id: String,
    /// Its digest; empty for an import.
    pub digest: String,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_better_than_ideal_only_where_everything_measured_says_so() {
        let measured = |test_loss: f64, captured_db: Option<f64>| KernelMetrics {
            test_pairs: 2,
            test_loss,
            ideal_test_loss: 0.5,
            captured: captured_db.map(|psnr_db| CapturedQuality { psnr_db, ideal_psnr_db: 20.0 }),
            ..KernelMetrics::default()
        };
        assert!(!KernelMetrics::default().no_better_than_ideal(), "imported: nothing was measured");
        assert!(!measured(0.4, None).no_better_than_ideal());
        assert!(!measured(0.4, Some(21.0)).no_better_than_ideal());
        assert!(measured(0.5, None).no_better_than_ideal());
        assert!(measured(f64::NAN, None).no_better_than_ideal());
        assert!(measured(0.4, Some(19.0)).no_better_than_ideal());
    }
}
