//! The field `kernel` of a request: which kernels a job uses.

use crate::names;
use lightpath_domain::kernel::KernelKey;
use lightpath_proto::v1::{self, kernel_choice::Kind};
use lightpath_service::{Call, Field, KernelChoice, Result};

/// Checks a choice. `unset` is what stands for no choice.
pub(super) fn from_wire(
    call: &Call,
    field: &Field,
    choice: Option<v1::KernelChoice>,
    unset: KernelChoice,
) -> Result<KernelChoice> {
    let Some(choice) = choice else { return Ok(unset) };
    Ok(match field.required(choice.kind)? {
        Kind::Ideal(_) => KernelChoice::Ideal,
        Kind::Active(_) => KernelChoice::Active,
        Kind::Alias(alias) => KernelChoice::Alias(alias),
        Kind::Version(name) => {
            let (kernel, version) = names::kernel_version(call, &field.at("version"), &name)?;
            KernelChoice::Version(kernel, version)
        }
    })
}

/// The choice of the kernels that a job uses, with the number of the version; `None`: the ideal one. Unset for several
/// versions, which no choice names; the message of the job lists them.
pub(super) fn to_wire(kernels: &[(KernelKey, Option<u32>)]) -> Option<v1::KernelChoice> {
    match kernels {
        [(key, Some(version))] => Some(v1::KernelChoice::version(format!("{key}/versions/{version}"))),
        kernels => kernels.iter().all(|(_, version)| version.is_none()).then(v1::KernelChoice::ideal),
    }
}
