//! Resolution of the field `kernel` of a job into a kernel version.

use super::Kernels;
use crate::error::{Result, ServiceError};
use crate::field::{Field, shortened};
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;
use std::collections::BTreeMap;

/// Which kernel a job uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum KernelChoice {
    /// The active version, or the ideal kernel if none is active.
    ActiveOrIdeal,
    /// The ideal kernel.
    Ideal,
    /// The active version.
    Active,
    /// The version that an alias names.
    Alias(String),
    /// A version, by its kernel and number.
    Version(KernelKey, u32),
}

impl KernelChoice {
    /// Whether it stands for the active version. A repeated request keeps the one that was active the first time. With an
    /// alias that moved it is refused instead, because the stored job does not tell one alias from another.
    pub fn follows_active(&self) -> bool {
        matches!(self, Self::Active | Self::ActiveOrIdeal)
    }
}

impl Kernels {
    /// The version of the kernel `key` for which `choice` stands; `None`: the ideal kernel.
    pub async fn chosen(&self, field: &Field, choice: &KernelChoice, key: &KernelKey) -> Result<Option<u32>> {
        match choice {
            KernelChoice::Ideal => Ok(None),
            KernelChoice::ActiveOrIdeal => self.active_version(key).await,
            KernelChoice::Active => self.active_version(key).await?.map(Some).ok_or_else(|| {
                let fix = "promote a version first, or name a version or the ideal kernel";
                let message = format!("{field}: no version of {key} is active; {fix}");
                ServiceError::Precondition { reason: PreconditionReason::NoActiveKernel, message }
            }),
            KernelChoice::Alias(alias) => self.version_of_alias(&field.at("alias"), alias, key).await.map(Some),
            KernelChoice::Version(kernel, version) => {
                let field = field.at("version");
                if kernel != key {
                    let fix = format!("must be a version of {key}, the kernel of this wavelength and place");
                    return Err(field.but(format!("is a version of {kernel}"), fix));
                }
                match self.store.kernel_version(key, *version).await {
                    Err(StoreError::NotFound { resource }) => {
                        Err(field.missing(resource, "name one of the kernel's versions"))
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
            let there: Vec<&str> = aliases.keys().map(String::as_str).collect();
            let there = if there.is_empty() { "it has none".to_owned() } else { there.join(", ") };
            let rule = format!("must be an alias of {key}: {there}");
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
