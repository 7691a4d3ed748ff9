//! The queue as a whole: its turns, pauses and processes.

use super::Jobs;
use crate::call::Call;
use crate::error::Result;
use lightpath_store::{OwnerQueue, Pause, Process};
use std::sync::Arc;

/// The queue and its processes, as a caller may see them.
#[derive(Clone, Debug)]
pub struct QueueState {
    /// The turns of owners. A caller whose token is for some displays does not see them, because the jobs of owners may
    /// be about any display.
    pub owner_queues: Vec<OwnerQueue>,
    /// The pauses of all displays, or of the caller's.
    pub pauses: Vec<Pause>,
    /// The living processes.
    pub processes: Arc<[Process]>,
}

impl Jobs {
    /// The queue and its processes as the caller may see it.
    pub async fn queue(&self, call: &Call) -> Result<QueueState> {
        let pauses = self.store.pauses().await?;
        if call.caller.displays.is_empty() {
            let owner_queues = self.store.owner_queues().await?;
            return Ok(QueueState { owner_queues, pauses, processes: self.store.living() });
        }
        let is_own = |pause: &Pause| pause.display.as_ref().is_none_or(|display| call.caller.may_use(display));
        let pauses = pauses.into_iter().filter(is_own).collect();
        Ok(QueueState { owner_queues: Vec::new(), pauses, processes: self.store.living() })
    }

    /// Pauses the jobs of a display; `None`: of all displays.
    pub async fn pause(&self, call: &Call, display: Option<&str>, reason: &str) -> Result<QueueState> {
        self.store.pause(display, reason, self.store.now_ms()).await?;
        self.queue(call).await
    }

    /// Ends a pause.
    pub async fn resume(&self, call: &Call, display: Option<&str>) -> Result<QueueState> {
        self.store.resume(display).await?;
        self.queue(call).await
    }
}
