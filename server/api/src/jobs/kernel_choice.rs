//! Which kernel version a job's `kernel` stands for.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::{Field, shortened};
use lightpath_domain::kernel::KernelKey;
use lightpath_store::StoreError;

impl Api {
    /// `None`: the ideal kernel. Empty means the active kernel and, unless it is `required`, the ideal one where none
    /// is active.
    pub(crate) async fn kernel_version_for(
        &self,
        field: &Field,
        kernel: &str,
        key: &KernelKey,
        required: bool,
    ) -> Result<Option<u32>, ApiError> {
        match kernel {
            "ideal" => Ok(None),
            "" | "active" => {
                let active = self.active_version(key).await?;
                if active.is_none() && (required || kernel == "active") {
                    let fix = "promote a version first, or name a version or `ideal`";
                    let message = format!("{field}: no version of {key} is active; {fix}");
                    return Err(ApiError::Precondition { reason: "NO_ACTIVE_KERNEL", message });
                }
                Ok(active)
            }
            number => {
                let form = "but must be `ideal`, `active` or a version number from 1";
                let refusal = || field.invalid(format!("is {:?}, {form}", shortened(number)));
                let version: u32 = number.parse().map_err(|_| refusal())?;
                match self.store.kernel_version(key, version).await {
                    Err(StoreError::NotFound { what }) => {
                        Err(field.missing(what, "name one of the kernel's versions, `active` or `ideal`"))
                    }
                    other => Ok(Some(other?.version)),
                }
            }
        }
    }

    async fn active_version(&self, key: &KernelKey) -> Result<Option<u32>, ApiError> {
        match self.store.kernel(key).await {
            Ok(kernel) => Ok(kernel.active_version),
            // A kernel exists once it has a version.
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}

/// What a job's `kernel` was resolved to, in the form that a request may name it.
pub(crate) fn kernel_named(version: Option<u32>) -> String {
    version.map_or_else(|| "ideal".to_owned(), |version| version.to_string())
}
