//! Conversion of rollouts into messages.

use crate::enumerations::OnWire as _;
use crate::time::timestamp;
use lightpath_domain::rollout::{Halting, Rollout, RolloutEvent};
use lightpath_proto::v1;

/// Converts a rollout into its message.
pub(super) fn rollout(rollout: Rollout, halting: Option<Halting>, events: Vec<RolloutEvent>) -> v1::Rollout {
    let plan = rollout.plan;
    v1::Rollout {
        name: format!("{}/rollouts/{}", rollout.key, rollout.number),
        version: plan.version,
        from_version: rollout.from_version,
        state: rollout.state.to_wire(),
        share: plan.share,
        group: plan.group,
        failed_share_max: plan.failed_share_max,
        devices_min: plan.devices_min,
        self_test_loss_max: plan.self_test_loss_max,
        devices_passed: rollout.devices_passed,
        devices_failed: rollout.devices_failed,
        start_time: Some(timestamp(rollout.start_time_ms)),
        end_time: rollout.end_time_ms.map(timestamp),
        revision: rollout.revision,
        events: events.into_iter().map(event).collect(),
        halting: halting.map(|halting| v1::rollout::Halting {
            devices_known: halting.devices_known,
            failures_first: halting.failures_first,
            failures_of_all: halting.failures_of_all,
        }),
    }
}

fn event(event: RolloutEvent) -> v1::RolloutEvent {
    v1::RolloutEvent {
        time: Some(timestamp(event.time_ms)),
        caller: event.caller,
        message: event.message,
        generation: event.generation,
    }
}
