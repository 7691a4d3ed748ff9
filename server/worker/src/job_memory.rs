//! Memory that running jobs share: the sum of their estimates stays below a limit.
//!
//! A claimed job waits, in the order of the claims, until the jobs before it leave enough memory. It keeps its lease
//! meanwhile.

use lightpath_domain::job::{Job, Progress};
use std::sync::Arc;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

const MIB: u64 = 1 << 20;
/// Part of the limit that is at most kept for transfer functions from job to job.
const CACHE_PART: u64 = 8;
/// Largest memory for these transfer functions \[bytes\]: about four planes of 1920×1080 px.
const CACHE_BYTES_MAX: u64 = 256 << 20;

/// Limit on the memory of running jobs, with what is left of it. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct JobMemory {
    free_mib: Arc<Semaphore>,
    limit_mib: u32,
}

/// Memory of a running job. Dropping it gives the memory back.
#[derive(Debug)]
pub(super) struct MemoryShare(#[expect(dead_code, reason = "dropping it gives the memory back")] OwnedSemaphorePermit);

/// Memory for transfer functions that are kept from job to job \[bytes\], as a part of the limit on the memory of jobs.
#[must_use]
pub fn cache_bytes_max(limit_bytes: u64) -> u64 {
    (limit_bytes / CACHE_PART).min(CACHE_BYTES_MAX)
}

/// Memory for running jobs \[bytes\]: the limit, less the memory for transfer functions.
#[must_use]
pub fn jobs_bytes_max(limit_bytes: u64) -> u64 {
    limit_bytes - cache_bytes_max(limit_bytes)
}

impl JobMemory {
    /// The limit \[bytes\], less the memory of the cache.
    pub(super) fn new(limit_bytes: u64) -> Self {
        let limit_mib = u32::try_from(jobs_bytes_max(limit_bytes) / MIB).unwrap_or(u32::MAX).max(1);
        Self { free_mib: Arc::new(Semaphore::new(limit_mib as usize)), limit_mib }
    }

    /// Waits until the memory of the job is free. Calls `report` first if the job has to wait. A job whose estimate
    /// exceeds the limit, because the limit was lowered, runs alone.
    pub(super) async fn share(&self, job: &Job, report: impl FnOnce(Progress)) -> Option<MemoryShare> {
        let wanted_mib = u32::try_from(job.estimate.memory_bytes.div_ceil(MIB)).unwrap_or(u32::MAX).min(self.limit_mib);
        let now = Arc::clone(&self.free_mib).try_acquire_many_owned(wanted_mib);
        if let Ok(permit) = now {
            return Some(MemoryShare(permit));
        }
        let free_mib = self.free_mib.available_permits();
        let stage = format!("wait for memory: {wanted_mib} MiB needed, {free_mib} of {} MiB free", self.limit_mib);
        report(Progress { stage, step: 0, steps_total: 0, loss: None, eta_s: None });
        // The semaphore is never closed.
        Arc::clone(&self.free_mib).acquire_many_owned(wanted_mib).await.ok().map(MemoryShare)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cache_takes_at_most_an_eighth() {
        assert_eq!(cache_bytes_max(800 << 20), 100 << 20);
        assert_eq!(cache_bytes_max(1 << 40), CACHE_BYTES_MAX);
    }
}
