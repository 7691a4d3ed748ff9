//! Jobs that make the report of a kernel version: request and result.

use crate::kernel::KernelKey;
use serde::{Deserialize, Serialize};

/// Largest number of other versions in a report. The newest ones are used.
pub const OTHER_VERSIONS_MAX: u32 = 12;

/// Request to make the report of a kernel version.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportKernel {
    /// Key of the kernel.
    pub kernel: KernelKey,
    /// Number of the kernel version.
    pub version: u32,
}

/// Report of a kernel version, for people.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportResult {
    /// Artifact digest of the report as one HTML file, with all pictures in it.
    pub html: String,
    /// Artifact digest of the report's numbers (`.npz`).
    pub arrays: String,
    /// Pictures of the report, in order.
    pub figures: Vec<ReportFigure>,
}

/// A picture of a report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportFigure {
    /// File name, with the extension `.png` or `.svg`.
    pub name: String,
    /// Title of the picture.
    pub title: String,
    /// Artifact digest of the picture.
    pub artifact: String,
}
