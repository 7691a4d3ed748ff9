//! Evaluation jobs: how well a kernel predicts a dataset.

use super::kernel_choice;
use crate::api::Api;
use crate::enumerations::OnWire as _;
use crate::names;
use crate::optics::from_wire::region;
use crate::optics::to_wire::{region_message, validity_report};
use lightpath_domain::job::{EvaluateKernel, EvaluateResult, Job};
use lightpath_domain::kernel::KernelKey;
use lightpath_proto::v1;
use lightpath_service::propagation::check_distance;
use lightpath_service::{Call, Field, KernelChoice, Result};

/// Checks a request, looks up the named resources, fills in defaults, and converts the request. `before` is the job
/// of an earlier submission of the same request.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::EvaluateKernel,
    field: &Field,
    before: Option<&Job>,
) -> Result<EvaluateKernel> {
    let at = |name| field.at(name);
    let id = names::dataset_id(&at("dataset"), &message.dataset)?;
    let (dataset, display) = api.service.datasets.finalized(call, &at("dataset"), &id).await?;
    check_distance(&at("dataset"), &display, dataset.wavelength, dataset.distance)?;
    let region_of_interest = region(&at("region"), message.region, &display)?;
    let key = dataset.kernel_key();
    let choice = kernel_choice::from_wire(call, &at("kernel"), message.kernel, KernelChoice::Active)?;
    let kernel_version = api.service.jobs.evaluated_version(&at("kernel"), &choice, &key, before).await?;
    Ok(EvaluateKernel { dataset: dataset.id, kernel: key, kernel_version, region_of_interest })
}

/// Converts the request, with its defaults and the kernel that it uses, into its message.
pub(super) fn to_wire(spec: EvaluateKernel, kernels: &[(KernelKey, Option<u32>)]) -> v1::EvaluateKernel {
    v1::EvaluateKernel {
        dataset: format!("datasets/{}", spec.dataset),
        kernel: kernel_choice::to_wire(kernels),
        region: Some(region_message(spec.region_of_interest)),
    }
}

/// Converts the result into its message.
pub(super) fn result(result: EvaluateResult) -> v1::EvaluateKernelResult {
    let pairs = result.pairs.into_iter().map(|pair| v1::evaluate_kernel_result::PairLoss {
        pair: pair.pair,
        split: pair.split.to_wire(),
        loss: pair.loss,
        loss_full_frame: pair.loss_full_frame,
    });
    v1::EvaluateKernelResult { pairs: pairs.collect(), propagation: Some(validity_report(result.propagation)) }
}
