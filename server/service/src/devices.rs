//! Devices: what they report, and their groups.

use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::kernels::{Kernels, for_device};
use lightpath_domain::device::{Device, InstalledFile, Report};
use lightpath_domain::kernel::KernelKey;
use lightpath_store::Store;

/// Devices in the field.
#[derive(Clone, Debug)]
pub struct Devices {
    store: Store,
    kernels: Kernels,
}

impl Devices {
    pub(crate) fn new(store: Store, kernels: Kernels) -> Self {
        Self { store, kernels }
    }

    /// Checks the generation that a device says to have. A device cannot have accepted what the server has not signed.
    pub async fn signed_generation(&self, field: &Field, key: &KernelKey, generation: u64) -> Result<u64> {
        let newest = self.store.kernel_moment(key, None).await?.generation;
        field.integer(generation, 0..=newest)
    }

    /// Refuses a file that the server does not have: a device with other bytes has another kernel.
    pub async fn require_file(&self, call: &Call, key: &KernelKey, file: &InstalledFile) -> Result<()> {
        let version = self.store.kernel_version(key, file.version).await?;
        let digest = for_device(self.kernels.file(call, version, file.form)).await?.digest;
        if digest == file.digest {
            return Ok(());
        }
        let name = format!("{key}/versions/{} in the form {}", file.version, file.form.as_str());
        Err(Field::new("digest").but(format!("is {}", file.digest), format!("{name} has {digest}")))
    }

    /// Stores what a device reports.
    pub async fn report(&self, report: Report) -> Result<()> {
        Ok(self.store.report_device(report).await?)
    }

    /// Puts a device into a group; an empty text: into none.
    pub async fn set_group(&self, display: &str, device: &str, group: &str) -> Result<Device> {
        Ok(self.store.set_device_group(display, device, group, self.store.now_ms()).await?)
    }

    /// Forgets a device.
    pub async fn delete(&self, display: &str, device: &str) -> Result<()> {
        Ok(self.store.delete_device(display, device).await?)
    }
}
