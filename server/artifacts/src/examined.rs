//! Files that were hashed recently, so that clients cannot make the server hash the same files again and again.

use crate::folder::Stamp;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

/// Time for which a finding about a file holds while the file does not change: long compared with the time of hashing
/// it, short compared with the time in which disks damage files.
const HOLDS_FOR: Duration = Duration::from_secs(600);
/// Limit on the remembered findings, for their memory: about 2 MB.
const FINDINGS_MAX: usize = 10_000;
/// Time for which a call waits until other files have been hashed: a large file on a slow disk.
const TURN_MAX: Duration = Duration::from_secs(10);

/// What was found out about files.
#[derive(Debug)]
pub(crate) struct Examined {
    /// Only one file is hashed at a time.
    turn: Arc<Semaphore>,
    findings: Mutex<HashMap<String, Finding>>,
}

/// Whether a file had the content of its digest.
#[derive(Clone, Copy, Debug)]
struct Finding {
    is_intact: bool,
    stamp: Stamp,
    time: Instant,
}

impl Default for Examined {
    fn default() -> Self {
        Self { turn: Arc::new(Semaphore::new(1)), findings: Mutex::default() }
    }
}

impl Examined {
    /// Waits for permission to hash a file; `None` if others hash for too long.
    pub(crate) async fn turn(&self) -> Option<OwnedSemaphorePermit> {
        timeout(TURN_MAX, Arc::clone(&self.turn).acquire_owned()).await.ok()?.ok()
    }

    /// Whether the file was intact when it was hashed; `None` if that was long ago, or the file has changed since.
    pub(crate) fn finding(&self, digest: &str, stamp: Stamp) -> Option<bool> {
        let finding = self.findings().get(digest).copied()?;
        (finding.stamp == stamp && finding.time.elapsed() < HOLDS_FOR).then_some(finding.is_intact)
    }

    pub(crate) fn record(&self, digest: &str, stamp: Stamp, is_intact: bool) {
        let mut findings = self.findings();
        if findings.len() >= FINDINGS_MAX {
            findings.clear();
        }
        findings.insert(digest.to_owned(), Finding { is_intact, stamp, time: Instant::now() });
    }

    pub(crate) fn forget(&self, digest: &str) {
        self.findings().remove(digest);
    }

    fn findings(&self) -> MutexGuard<'_, HashMap<String, Finding>> {
        // The map is consistent even after a panic: each change of it is a single operation.
        self.findings.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
