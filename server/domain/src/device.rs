//! Devices: displays in the field that fetch kernels.

use crate::kernel::KernelKey;
use crate::kernel_format::KernelFormat;

/// A device.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Id of the display that the device is one of.
    pub display: String,
    /// Id of the device.
    pub id: String,
    /// Group for rollouts; empty: none.
    pub group: String,
    /// Program of the device and its version.
    pub agent: String,
    /// Time of the last report \[ms since 1970\]; `None`: it has not reported yet.
    pub report_time_ms: Option<i64>,
    /// What it uses, by the names of the kernels.
    pub kernels: Vec<InstalledKernel>,
}

/// The kernel that a device uses at a wavelength and distance.
#[derive(Clone, Debug, PartialEq)]
pub struct InstalledKernel {
    /// The kernel.
    pub kernel: KernelKey,
    /// The file in use; `None`: none.
    pub file: Option<InstalledFile>,
    /// Generation of the manifest that the device accepted last.
    pub generation: u64,
    /// Version that the device tried and gave up.
    pub tried_version: Option<u32>,
    /// Why it gave up, or what else it had to say.
    pub message: String,
    /// Loss of a test photograph, measured by the device.
    pub self_test_loss: Option<f64>,
    /// Time of the report \[ms since 1970\].
    pub report_time_ms: i64,
}

/// The file that a device uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InstalledFile {
    /// Number of the version.
    pub version: u32,
    /// Form of the file.
    pub form: KernelFormat,
    /// Digest of the file.
    pub digest: String,
}

/// A report of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Id of the device.
    pub device: String,
    /// Program of the device and its version.
    pub agent: String,
    /// What the device uses.
    pub installed: InstalledKernel,
}
