//! Kernels: learned light transport, versioned per display, wavelength and distance.

pub use lightpath_optics::KernelModel;

use crate::lineage::KernelLineage;
use crate::units::{Distance, Wavelength};
use lightpath_optics::learning::PartCost;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Limit on the versions of a kernel: several a day for years. Each version and its file are kept for ever.
pub const VERSIONS_MAX: u32 = 10_000;

/// The key of a kernel. It is displayed as the resource name, `displays/lab-2/kernels/515nm-150mm`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct KernelKey {
    /// Id of the display.
    pub display: String,
    /// Wavelength in vacuum.
    pub wavelength: Wavelength,
    /// Distance from the SLM to the image plane.
    pub distance: Distance,
}

impl fmt::Display for KernelKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "displays/{}/kernels/{}-{}", self.display, self.wavelength, self.distance)
    }
}

/// A kernel: its key and its active version.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Display, wavelength and distance.
    pub key: KernelKey,
    /// Number of the active version; `None`: no version is active.
    pub active_version: Option<u32>,
    /// Number of the newest version. Versions count from 1.
    pub latest_version: u32,
    /// Whether the active version (or the newest, if none is active) was interpolated between photographed distances.
    pub interpolated: bool,
    /// Time when the kernel was created \[ms since 1970\].
    pub create_time_ms: i64,
    /// Versions that aliases other than `active` name.
    pub aliases: BTreeMap<String, u32>,
    /// Number of the running rollout.
    pub rollout: Option<u32>,
}

/// A learned or imported kernel before it has a version number. It becomes the kernel's next version.
#[derive(Clone, Debug, PartialEq)]
pub struct NewKernelVersion {
    /// Parametrization of the kernel.
    pub model: KernelModel,
    /// Artifact digest of the safetensors file.
    pub artifact: String,
    /// Size of the safetensors file \[bytes\].
    pub size_bytes: u64,
    /// Measured quality of the kernel.
    pub metrics: KernelMetrics,
    /// Origin of the kernel.
    pub lineage: KernelLineage,
}

/// A version of a kernel, which never changes.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelVersion {
    /// Key of the kernel.
    pub key: KernelKey,
    /// Number of the version, from 1.
    pub version: u32,
    /// Content of the version.
    pub content: NewKernelVersion,
    /// Time when the version was created \[ms since 1970\].
    pub create_time_ms: i64,
    /// Whether this is the active version.
    pub active: bool,
    /// Why the version should not be used any more; `None`: it may be used.
    pub deprecation: Option<Deprecation>,
}

/// Why a version should not be used any more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Deprecation {
    /// Time of the deprecation \[ms since 1970\].
    pub time_ms: i64,
    /// Who deprecated the version, and why.
    pub cause: Cause,
}

/// Mean squared errors between photographs and predictions. Saturated pixels are left out, gain and black level are
/// fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelMetrics {
    /// Number of pairs for learning.
    pub train_pairs: u32,
    /// Number of pairs for validation.
    pub validation_pairs: u32,
    /// Number of pairs for testing.
    pub test_pairs: u32,
    /// Loss of the training pairs in the region of interest.
    pub train_loss: f64,
    /// Loss of the validation pairs in the region of interest; 0 without validation pairs.
    pub validation_loss: f64,
    /// Loss of the test pairs in the region of interest.
    pub test_loss: f64,
    /// Loss of the test pairs in the region of interest with the ideal kernel.
    pub ideal_test_loss: f64,
    /// Loss of the test pairs over the full frame.
    pub test_loss_full_frame: f64,
    /// Loss of the test pairs over the full frame with the ideal kernel.
    pub ideal_test_loss_full_frame: f64,
    /// Quality of photographs of new holograms; `None` for displays that are not simulated.
    pub captured: Option<CapturedQuality>,
    /// What each part of the model explains of the test photographs, or of the validation photographs if there are
    /// none.
    #[serde(default)]
    pub parts: Vec<PartCost>,
}

/// Quality of a simulated display's photographs of new holograms, as a mean over some targets \[dB\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapturedQuality {
    /// PSNR with the kernel \[dB\].
    pub psnr_db: f64,
    /// PSNR with the ideal kernel \[dB\].
    pub ideal_psnr_db: f64,
}

impl KernelMetrics {
    /// Whether anything was measured. Imported and interpolated versions were not, unless a bundle brought their metrics.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        *self != Self::default()
    }

    /// Whether the kernel was measured and not shown to be better than the ideal kernel, neither in predicting test
    /// photographs nor (if measured) in photographs of new holograms.
    #[must_use]
    pub fn no_better_than_ideal(&self) -> bool {
        // The comparison is false for losses that are not numbers.
        let predicts_better = self.test_loss < self.ideal_test_loss;
        let shows_better = self.captured.is_none_or(|captured| captured.psnr_db > captured.ideal_psnr_db);
        (self.test_pairs > 0 && !predicts_better) || !shows_better
    }
}

/// Who changed something, and why.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cause {
    /// Name of the caller's token; empty: no token was required.
    pub caller: String,
    /// Reason that the caller gave.
    pub reason: String,
}

/// The alias that holograms and devices follow.
pub const ACTIVE: &str = "active";

/// A change of the version that an alias names.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelMove {
    /// Sequence number, which grows over all kernels. Pages of moves continue from it.
    pub sequence: i64,
    /// [`ACTIVE`] or another alias.
    pub alias: String,
    /// Time of the move \[ms since 1970\].
    pub time_ms: i64,
    /// Who made the move, and why.
    pub cause: Cause,
    /// Version that the alias named before; `None`: no version.
    pub from_version: Option<u32>,
    /// Version that it names now; `None`: the alias was removed.
    pub to_version: Option<u32>,
    /// What failed of the promotion gate and was overridden.
    pub overridden: Vec<String>,
    /// Generation of the display after the move.
    pub generation: u64,
    /// Whether the move was a rollback.
    pub rollback: bool,
}

/// What a manifest says changes with these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelMoment {
    /// Version for the device that asks: the active one, or that of a rollout; `None`: no version is active.
    pub version: Option<u32>,
    /// Generation of the display.
    pub generation: u64,
    /// Time when the display reached its generation \[ms since 1970\].
    pub generation_time_ms: i64,
    /// Number of the newest keyring; `None`: the server has none.
    pub keyring_version: Option<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_is_better_than_ideal_only_if_all_measurements_are_better() {
        let measured = |test_loss: f64, captured_db: Option<f64>| KernelMetrics {
            test_pairs: 2,
            test_loss,
            ideal_test_loss: 0.5,
            captured: captured_db.map(|psnr_db| CapturedQuality { psnr_db, ideal_psnr_db: 20.0 }),
            ..KernelMetrics::default()
        };
        assert!(!KernelMetrics::default().is_measured() && measured(0.4, None).is_measured());
        assert!(!KernelMetrics::default().no_better_than_ideal(), "imported: nothing was measured");
        assert!(!measured(0.4, None).no_better_than_ideal());
        assert!(!measured(0.4, Some(21.0)).no_better_than_ideal());
        assert!(measured(0.5, None).no_better_than_ideal());
        assert!(measured(f64::NAN, None).no_better_than_ideal());
        assert!(measured(0.4, Some(19.0)).no_better_than_ideal());
    }
}
