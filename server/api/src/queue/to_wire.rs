//! Conversion of the queue into a message.

use crate::time::timestamp;
use lightpath_proto::v1;
use lightpath_store::{OwnerQueue, Pause};

/// Converts the state of the queue into its message.
pub(crate) fn queue(owner_queues: Vec<OwnerQueue>, pauses: Vec<Pause>) -> v1::Queue {
    v1::Queue {
        queued: owner_queues.iter().map(|queue| queue.queued).sum(),
        running: owner_queues.iter().map(|queue| queue.running).sum(),
        turns: owner_queues
            .into_iter()
            .map(|queue| v1::queue::Turn { owner: queue.owner, queued: queue.queued, running: queue.running })
            .collect(),
        pauses: pauses
            .into_iter()
            .map(|pause| v1::queue::Pause {
                display: pause.display.map(|id| format!("displays/{id}")).unwrap_or_default(),
                since: Some(timestamp(pause.time_ms)),
                reason: pause.reason,
            })
            .collect(),
        processes: Vec::new(),
    }
}
