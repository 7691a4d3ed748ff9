//! Announcements of changes, so that no listener needs to poll.

use lightpath_domain::kernel::KernelKey;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};
use tokio::sync::{Notify, broadcast, mpsc};

/// Announcements kept for a slow listener. A job announces about five changes a second. A listener that misses some
/// (`RecvError::Lagged`) reads the present state and continues.
const BACKLOG: usize = 1024;

/// Something that changed, for listeners who follow everything.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Changed {
    /// The job with this id.
    Job(String),
    /// The kernel: its versions, their names, or its rollouts.
    Kernel(KernelKey),
    /// The pauses of the queue.
    Queue,
    /// The display with this id, or its gate.
    Display(String),
    /// A dataset.
    Dataset {
        /// Its id.
        id: String,
        /// Id of its display.
        display: String,
    },
    /// A device.
    Device {
        /// Id of its display.
        display: String,
        /// Its id.
        id: String,
    },
}

/// A change that a transaction announces after its commit.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(super) enum Change {
    /// The job with this id has a new revision.
    Job(String),
    /// A user requested the cancellation of the running job with this id.
    Cancel(String),
    /// The kernel has a new version, or another version became `active`.
    Kernel(KernelKey),
    /// A job may have become ready to claim.
    Claimable,
    /// A webhook may have something to learn. Changes of kernels say so, too.
    Deliverable,
    /// Something changed that only listeners who follow everything want to know.
    Other(Changed),
}

#[derive(Debug)]
pub(super) struct Changes {
    pub(super) jobs: broadcast::Sender<String>,
    pub(super) cancels: broadcast::Sender<String>,
    pub(super) kernels: broadcast::Sender<KernelKey>,
    pub(super) claimable: Arc<Notify>,
    pub(super) deliverable: Arc<Notify>,
    pub(super) all: broadcast::Sender<Changed>,
    /// Tells the changes of this process to the one that started it.
    pub(super) passed_on: OnceLock<mpsc::UnboundedSender<Change>>,
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            jobs: broadcast::Sender::new(BACKLOG),
            cancels: broadcast::Sender::new(BACKLOG),
            kernels: broadcast::Sender::new(BACKLOG),
            claimable: Arc::default(),
            deliverable: Arc::default(),
            all: broadcast::Sender::new(BACKLOG),
            passed_on: OnceLock::new(),
        }
    }
}

impl Changes {
    pub(super) fn publish(&self, changes: Vec<Change>) {
        for change in changes {
            // A send fails only if there is no listener, which is no error.
            if let Some(passed_on) = self.passed_on.get() {
                drop(passed_on.send(change.clone()));
            }
            match change {
                Change::Job(id) => {
                    drop(self.all.send(Changed::Job(id.clone())));
                    drop(self.jobs.send(id));
                }
                Change::Cancel(id) => drop(self.cancels.send(id)),
                Change::Kernel(key) => {
                    drop(self.all.send(Changed::Kernel(key.clone())));
                    drop(self.kernels.send(key));
                    self.deliverable.notify_one();
                }
                Change::Other(changed) => drop(self.all.send(changed)),
                Change::Claimable => self.claimable.notify_one(),
                Change::Deliverable => self.deliverable.notify_one(),
            }
        }
    }
}
