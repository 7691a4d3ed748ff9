//! Listening to what changes in the store.

use super::Store;
use lightpath_domain::kernel::KernelKey;
use std::sync::Arc;
use tokio::sync::{Notify, broadcast};

impl Store {
    /// Ids of jobs, each after a change of the job is on disk. Subscribe first, then read, and nothing is missed.
    #[must_use]
    pub fn subscribe_job_changes(&self) -> broadcast::Receiver<String> {
        self.inner.changes.jobs.subscribe()
    }

    /// Ids of running jobs whose end somebody asked for.
    #[must_use]
    pub fn subscribe_cancels(&self) -> broadcast::Receiver<String> {
        self.inner.changes.cancels.subscribe()
    }

    /// Kernels that got a version or whose `active` moved, each after it is on disk.
    #[must_use]
    pub fn subscribe_kernel_changes(&self) -> broadcast::Receiver<KernelKey> {
        self.inner.changes.kernels.subscribe()
    }

    /// Notified when a job may be there to claim. One permit is kept, so a worker that claims in a loop until there
    /// is nothing left, and only then waits, misses none.
    #[must_use]
    pub fn claimable(&self) -> Arc<Notify> {
        Arc::clone(&self.inner.changes.claimable)
    }
}
