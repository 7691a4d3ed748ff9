//! Conversion of the requests and results of evaluation jobs into messages.

use crate::enumerations::OnWire as _;
use crate::jobs::kernel_choice::kernel_text;
use crate::optics::to_wire::{region, validity_report};
use lightpath_domain::job::{EvaluateKernel, EvaluateResult};
use lightpath_proto::v1;

/// Converts the request, with its defaults, into its message.
pub(crate) fn spec(spec: EvaluateKernel) -> v1::EvaluateKernel {
    v1::EvaluateKernel {
        dataset: format!("datasets/{}", spec.dataset),
        kernel: kernel_text(spec.kernel_version),
        region_of_interest: Some(region(spec.region_of_interest)),
    }
}

/// Converts the result into its message.
pub(crate) fn result(result: EvaluateResult) -> v1::EvaluateResult {
    let pairs = result.pairs.into_iter().map(|pair| v1::evaluate_result::PairLoss {
        pair: pair.pair,
        split: pair.split.to_wire(),
        loss: pair.loss,
        loss_full_frame: pair.loss_full_frame,
    });
    v1::EvaluateResult { pairs: pairs.collect(), propagation: Some(validity_report(result.propagation)) }
}
