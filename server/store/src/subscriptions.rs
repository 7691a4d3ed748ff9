//! Receiving announcements of changes in the store.

use super::{Changed, Store};
use lightpath_domain::kernel::KernelKey;
use std::sync::Arc;
use tokio::sync::{Notify, broadcast};

impl Store {
    /// Receives the id of each changed job, after the change is on disk. A caller that subscribes first and reads then
    /// misses no change.
    #[must_use]
    pub fn subscribe_job_changes(&self) -> broadcast::Receiver<String> {
        self.inner.changes.jobs.subscribe()
    }

    /// Receives the ids of running jobs whose cancellation a user requested.
    #[must_use]
    pub fn subscribe_cancels(&self) -> broadcast::Receiver<String> {
        self.inner.changes.cancels.subscribe()
    }

    /// Receives the keys of kernels that got a version or another active version, after the change is on disk.
    #[must_use]
    pub fn subscribe_kernel_changes(&self) -> broadcast::Receiver<KernelKey> {
        self.inner.changes.kernels.subscribe()
    }

    /// Receives every change of a job, kernel, pause, display, dataset or device, after it is on disk.
    #[must_use]
    pub fn subscribe_changes(&self) -> broadcast::Receiver<Changed> {
        self.inner.changes.all.subscribe()
    }

    /// Notified when a job may be ready to claim. One permit is kept. So a worker misses no job if it claims until the
    /// queue has none left and waits only then.
    #[must_use]
    pub fn claimable(&self) -> Arc<Notify> {
        Arc::clone(&self.inner.changes.claimable)
    }

    /// Notified when a webhook may have something to learn, see [`Store::webhooks_due`]. One permit is kept.
    #[must_use]
    pub fn deliverable(&self) -> Arc<Notify> {
        Arc::clone(&self.inner.changes.deliverable)
    }
}
