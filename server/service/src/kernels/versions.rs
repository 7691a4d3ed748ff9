//! Versions that somebody names.

use super::Kernels;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;

impl Kernels {
    /// The version that a field names. Refuses one that does not exist.
    pub async fn existing_version(&self, field: &Field, key: &KernelKey, version: u32) -> Result<KernelVersion> {
        match self.store.kernel_version(key, version).await {
            Err(StoreError::NotFound { resource }) => Err(field.missing(resource, "name one of the kernel's versions")),
            found => found.map_err(ServiceError::from),
        }
    }

    /// A version; `None`: the active one. Refuses a kernel without an active version.
    pub async fn version_or_active(&self, key: &KernelKey, version: Option<u32>) -> Result<KernelVersion> {
        let number = match version {
            Some(number) => number,
            None => self.require_active(key).await?,
        };
        Ok(self.store.kernel_version(key, number).await?)
    }

    /// Number of the active version. Refuses a kernel without one.
    async fn require_active(&self, key: &KernelKey) -> Result<u32> {
        self.store.kernel(key).await?.active_version.ok_or_else(|| {
            let message = format!("no version of {key} is active; promote one first, or give a version number");
            ServiceError::Precondition { reason: PreconditionReason::NoActiveKernel, message }
        })
    }
}
