//! Announcements of what has changed, so that nobody needs to poll.

use super::Store;
use lightpath_domain::kernel::KernelKey;
use std::sync::Arc;
use tokio::sync::{Notify, broadcast};

/// Announcements kept for a slow listener. A job tells of itself about five times a second; one that misses some
/// (`RecvError::Lagged`) reads the present state and goes on.
const BACKLOG: usize = 1024;

/// What a transaction announces.
#[derive(Clone, Debug)]
pub(super) enum Change {
    /// The job with this id has a new revision.
    Job(String),
    /// Somebody asked for the end of the running job with this id.
    Cancel(String),
    /// The kernel has a new version, or `active` moved.
    Kernel(KernelKey),
    /// A job may be there to claim.
    Claimable,
}

#[derive(Debug)]
pub(super) struct Changes {
    jobs: broadcast::Sender<String>,
    cancels: broadcast::Sender<String>,
    kernels: broadcast::Sender<KernelKey>,
    claimable: Arc<Notify>,
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            jobs: broadcast::Sender::new(BACKLOG),
            cancels: broadcast::Sender::new(BACKLOG),
            kernels: broadcast::Sender::new(BACKLOG),
            claimable: Arc::default(),
        }
    }
}

impl Changes {
    pub(super) fn publish(&self, changes: Vec<Change>) {
        for change in changes {
            // A send fails only where nobody listens, and then nobody misses it.
            match change {
                Change::Job(id) => drop(self.jobs.send(id)),
                Change::Cancel(id) => drop(self.cancels.send(id)),
                Change::Kernel(key) => drop(self.kernels.send(key)),
                Change::Claimable => self.claimable.notify_one(),
            }
        }
    }
}

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
