//! Limits on the open streams of all clients together.

use crate::error::{ApiError, LimitReason};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Limit on the streams that follow jobs and kernels: each needs a little memory, and a read at every change.
const WATCHERS_MAX: usize = 1000;
/// Limit on simultaneous uploads: each may hold what its connection has received, about 2 MiB.
const UPLOADS_MAX: usize = 64;

/// Counts of the open streams. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct StreamLimits {
    watchers: Arc<Semaphore>,
    uploads: Arc<Semaphore>,
}

impl Default for StreamLimits {
    fn default() -> Self {
        Self { watchers: Arc::new(Semaphore::new(WATCHERS_MAX)), uploads: Arc::new(Semaphore::new(UPLOADS_MAX)) }
    }
}

impl StreamLimits {
    /// Counts a stream that follows changes, until the permit is dropped.
    pub(crate) fn watcher(&self) -> Result<OwnedSemaphorePermit, ApiError> {
        Arc::clone(&self.watchers).try_acquire_owned().map_err(|_| ApiError::Exhausted {
            reason: LimitReason::TooManyWatchers,
            message: format!("{WATCHERS_MAX} streams already follow jobs and kernels; end one, or retry later"),
            retry_after: Duration::from_secs(5),
        })
    }

    /// Counts an upload, until the permit is dropped.
    pub(crate) fn upload(&self) -> Result<OwnedSemaphorePermit, ApiError> {
        Arc::clone(&self.uploads).try_acquire_owned().map_err(|_| ApiError::Exhausted {
            reason: LimitReason::TooManyUploads,
            message: format!("{UPLOADS_MAX} uploads already run; continue when one of them has ended"),
            retry_after: Duration::from_secs(1),
        })
    }
}
