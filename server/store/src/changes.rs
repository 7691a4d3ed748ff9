//! Announcements of what has changed, so that nobody needs to poll.

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
