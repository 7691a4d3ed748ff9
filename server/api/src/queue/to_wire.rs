//! Conversion of the queue into a message.

use crate::time::timestamp;
use lightpath_proto::v1;
use lightpath_store::{Pause, Turn};

/// Converts the state of the queue into its message.
pub(crate) fn queue(turns: Vec<Turn>, pauses: Vec<Pause>) -> v1::Queue {
    v1::Queue {
        queued: turns.iter().map(|turn| turn.queued).sum(),
        running: turns.iter().map(|turn| turn.running).sum(),
        turns: turns
            .into_iter()
            .map(|turn| v1::queue::Turn { owner: turn.owner, queued: turn.queued, running: turn.running })
            .collect(),
        pauses: pauses
            .into_iter()
            .map(|pause| v1::queue::Pause {
                display: pause.display.map(|id| format!("displays/{id}")).unwrap_or_default(),
                since: Some(timestamp(pause.time_ms)),
                reason: pause.reason,
            })
            .collect(),
    }
}
