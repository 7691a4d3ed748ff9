//! Resolution of the field `kernel` of a job into a kernel version.

use super::Kernels;
use crate::error::{Result, ServiceError};
use crate::field::{Field, shortened};
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;
use std::collections::BTreeMap;

impl Kernels {
    /// The kernel version for which `kernel` stands; `None`: the ideal kernel. An empty text stands for the active
    /// version or, if no version is active and the version is not `required`, for the ideal kernel.
    pub async fn chosen(&self, field: &Field, kernel: &str, key: &KernelKey, required: bool) -> Result<Option<u32>> {
        match kernel {
            "ideal" => Ok(None),
            "" | "active" => {
                let active = self.active_version(key).await?;
                if active.is_none() && (required || kernel == "active") {
                    let fix = "promote a version first, or give a version number or `ideal`";
                    let message = format!("{field}: no version of {key} is active; {fix}");
                    return Err(ServiceError::Precondition { reason: PreconditionReason::NoActiveKernel, message });
                }
                Ok(active)
            }
            text => {
                let version = match text.parse() {
                    Ok(number) => number,
                    Err(_) => self.version_of_alias(field, text, key).await?,
                };
                match self.store.kernel_version(key, version).await {
                    Err(StoreError::NotFound { resource }) => {
                        Err(field.missing(resource, "name one of the kernel's versions, `active` or `ideal`"))
                    }
                    other => Ok(Some(other?.version)),
                }
            }
        }
    }

    /// The version that an alias of the kernel names.
    async fn version_of_alias(&self, field: &Field, alias: &str, key: &KernelKey) -> Result<u32> {
        let aliases = match self.store.kernel(key).await {
            Ok(kernel) => kernel.aliases,
            Err(StoreError::NotFound { .. }) => BTreeMap::new(),
            Err(error) => return Err(error.into()),
        };
        aliases.get(alias).copied().ok_or_else(|| {
            let rule = format!("must be `ideal`, `active`, a version number from 1, or an alias of {key}");
            field.but(format!("is {:?}", shortened(alias)), rule)
        })
    }

    async fn active_version(&self, key: &KernelKey) -> Result<Option<u32>> {
        match self.store.kernel(key).await {
            Ok(kernel) => Ok(kernel.active_version),
            // A kernel does not exist before its first version.
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}
