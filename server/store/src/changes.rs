//! Announcements of changes, so that no listener needs to poll.

use lightpath_domain::kernel::KernelKey;
use std::sync::Arc;
use tokio::sync::{Notify, broadcast};

/// Announcements kept for a slow listener. A job announces about five changes a second. A listener that misses some
/// (`RecvError::Lagged`) reads the present state and continues.
const BACKLOG: usize = 1024;

/// A change that a transaction announces after its commit.
#[derive(Clone, Debug)]
pub(super) enum Change {
    /// The job with this id has a new revision.
    Job(String),
    /// A user requested the cancellation of the running job with this id.
    Cancel(String),
    /// The kernel has a new version, or another version became `active`.
    Kernel(KernelKey),
    /// A job may have become ready to claim.
    Claimable,
}

#[derive(Debug)]
pub(super) struct Changes {
    pub(super) jobs: broadcast::Sender<String>,
    pub(super) cancels: broadcast::Sender<String>,
    pub(super) kernels: broadcast::Sender<KernelKey>,
    pub(super) claimable: Arc<Notify>,
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
            // A send fails only if there is no listener, which is no error.
            match change {
                Change::Job(id) => drop(self.jobs.send(id)),
                Change::Cancel(id) => drop(self.cancels.send(id)),
                Change::Kernel(key) => drop(self.kernels.send(key)),
                Change::Claimable => self.claimable.notify_one(),
            }
        }
    }
}
