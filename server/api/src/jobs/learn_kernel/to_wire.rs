//! Jobs that learn kernels, and their results, as messages.

use crate::kernels::to_wire::{metrics, model};
use crate::optics::to_wire::{detector, region};
use lightpath_domain::job::{JointResult, LearnKernel, LearnResult};
use lightpath_proto::v1;

/// What was asked for, with its defaults.
pub(crate) fn spec(spec: LearnKernel) -> v1::LearnKernel {
    v1::LearnKernel {
        dataset: format!("datasets/{}", spec.dataset),
        model: model(spec.model),
        epochs: spec.epochs.unwrap_or(0),
        refinement_evaluations: spec.refinement_evaluations,
        learning_rate: spec.learning_rate.unwrap_or(0.0),
        seed: spec.seed,
        order: spec.order.unwrap_or(0),
        detector: detector(spec.detector),
        region_of_interest: Some(region(spec.region_of_interest)),
        start_version: spec.start_version.unwrap_or(0),
        joint_datasets: spec.joint_datasets.iter().map(|id| format!("datasets/{id}")).collect(),
    }
}

/// What was learned.
pub(crate) fn result(result: LearnResult) -> v1::LearnResult {
    v1::LearnResult {
        kernel_version: result.kernel_version,
        metrics: Some(metrics(&result.metrics)),
        loss_history: result.loss_history,
        left_out_pairs: result.left_out_pairs,
        order: result.order,
        joint: result.joint.into_iter().map(joint_result).collect(),
    }
}

fn joint_result(joint: JointResult) -> v1::learn_result::JointResult {
    v1::learn_result::JointResult { kernel_version: joint.kernel_version, metrics: Some(metrics(&joint.metrics)) }
}
