//! Conversion of the queue into a message.

use crate::enumerations::OnWire as _;
use crate::time::timestamp;
use lightpath_proto::v1;
use lightpath_service::QueueState;
use lightpath_store::Process;

/// Converts the state of the queue into its message.
pub(crate) fn queue(queue: QueueState) -> v1::Queue {
    let QueueState { owner_queues, pauses, processes } = queue;
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
        processes: processes.iter().cloned().map(process).collect(),
    }
}

fn process(process: Process) -> v1::queue::Process {
    v1::queue::Process {
        id: process.id,
        kind: process.kind.to_wire(),
        name: process.name,
        version: process.version,
        labels: process.abilities.labels.iter().map(str::to_owned).collect(),
        memory_bytes: (process.workers > 0).then_some(process.abilities.memory_bytes),
        workers: process.workers,
        start_time: Some(timestamp(process.start_time_ms)),
        seen_time: Some(timestamp(process.seen_time_ms)),
    }
}
