//! What a job that reports on a kernel is to do, and what it gave.

use crate::kernel::KernelKey;
use serde::{Deserialize, Serialize};

/// Make the report of a kernel version.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportKernel {
    /// The kernel.
    pub kernel: KernelKey,
    /// Number of the version.
    pub version: u32,
}

/// What a kernel version is like, for people.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportResult {
    /// Artifact digest of one HTML file with everything in it.
    pub html: String,
    /// Artifact digest of its numbers, `.npz`.
    pub arrays: String,
    /// Its pictures, in their order.
    pub figures: Vec<ReportFigure>,
}

/// A picture of a report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportFigure {
    /// A file name, `.png` or `.svg`.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// Artifact digest.
    pub artifact: String,
}
