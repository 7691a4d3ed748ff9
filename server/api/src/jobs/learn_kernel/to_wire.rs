//! Conversion of the requests and results of learning jobs into messages.

use crate::enumerations::OnWire as _;
use crate::kernels::to_wire::metrics;
use crate::optics::to_wire::{region, validity_report};
use lightpath_domain::job::{LearnKernel, LearnResult, LearnedKernel};
use lightpath_optics::learning::BlockStrengths;
use lightpath_proto::v1;

/// Converts the request, with its defaults, into its message.
pub(crate) fn spec(spec: LearnKernel) -> v1::LearnKernel {
    v1::LearnKernel {
        datasets: spec.datasets.iter().map(|id| format!("datasets/{id}")).collect(),
        model: spec.model.to_wire(),
        order: spec.order.unwrap_or(0),
        start_version: spec.start_version.unwrap_or(0),
        epochs: spec.epochs.unwrap_or(0),
        learning_rate: spec.learning_rate.unwrap_or(0.0),
        refinement_evaluations: spec.refinement_evaluations,
        seed: spec.seed,
        detector: spec.detector.to_wire(),
        region_of_interest: Some(region(spec.region_of_interest)),
    }
}

/// Converts the result into its message.
pub(crate) fn result(result: LearnResult) -> v1::LearnResult {
    v1::LearnResult {
        kernels: result.kernels.into_iter().map(kernel).collect(),
        loss_history: result.loss_history,
        order: result.order,
        blocks: Some(blocks(&result.blocks)),
        deviations: Some(blocks(&result.certainty.deviations)),
        hidden: Some(blocks(&result.certainty.hidden)),
    }
}

fn blocks(blocks: &BlockStrengths) -> v1::learn_result::BlockStrengths {
    v1::learn_result::BlockStrengths {
        surface_rms_rad: blocks.surface_rms_rad,
        crosstalk_x_px: blocks.crosstalk_px.map(|[x, _]| x),
        crosstalk_y_px: blocks.crosstalk_px.map(|[_, y]| y),
        response_variation_rms: blocks.response_variation_rms,
        kernel_varies: blocks.kernel_varies,
        dust_contrast: blocks.dust_contrast,
        ghost_share: blocks.ghost_share,
        image_spread_x_px: blocks.image_spread_px.map(|[x, _]| x),
        image_spread_y_px: blocks.image_spread_px.map(|[_, y]| y),
        light_blur_x_px: blocks.light_blur_px.map(|[x, _]| x),
        light_blur_y_px: blocks.light_blur_px.map(|[_, y]| y),
    }
}

fn kernel(kernel: LearnedKernel) -> v1::learn_result::LearnedKernel {
    v1::learn_result::LearnedKernel {
        kernel_version: kernel.kernel_version,
        dataset: format!("datasets/{}", kernel.dataset),
        metrics: Some(metrics(&kernel.metrics)),
        left_out_pairs: kernel.left_out_pairs,
        propagation: Some(validity_report(kernel.propagation)),
    }
}
