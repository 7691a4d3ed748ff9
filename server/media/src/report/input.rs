//! The input of a report.

use super::evidence::Evidence;
use lightpath_domain::kernel::KernelVersion;
use lightpath_optics::DisplayModel;

/// The data that a report is made from.
#[derive(Debug)]
pub struct ReportInput {
    /// The version that the report describes.
    pub version: KernelVersion,
    /// The display model of that version.
    pub model: DisplayModel,
    /// Losses during learning. Empty: unknown.
    pub loss_history: Vec<f64>,
    /// Evidence from the dataset. `None`: the kernel was imported, or the dataset cannot be read any more.
    pub evidence: Option<Evidence>,
    /// Other versions of the same kernel, newest first.
    pub other_versions: Vec<OtherVersion>,
    /// The models at all distances that were learned together, ascending. Empty: the kernel was learned at one
    /// distance.
    pub over_distance: Vec<DisplayModel>,
}

/// Another version of the same kernel.
#[derive(Clone, Debug)]
pub struct OtherVersion {
    /// Number of the version.
    pub version: u32,
    /// Loss on held-out pairs. `None`: no pair was held out.
    pub test_loss: Option<f64>,
    /// Display model of the version.
    pub model: DisplayModel,
}
