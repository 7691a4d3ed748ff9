//! Room on the disk: a reserve that no new work may use, so that what was accepted can end, and a limit on all artifacts.

use super::{ArtifactError, Artifacts};
use rustix::fs::statvfs;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// What new uploads and jobs must leave free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SpaceLimits {
    /// Bytes of the disk that only accepted work may use.
    pub reserve_bytes: u64,
    /// Most bytes of all artifacts together; 0: no limit but the disk.
    pub stored_bytes_max: u64,
}

#[derive(Debug)]
pub(super) struct Space {
    limits: SpaceLimits,
    stored_bytes: AtomicU64,
}

impl Space {
    pub(super) fn new(limits: SpaceLimits) -> Self {
        Self { limits, stored_bytes: AtomicU64::new(0) }
    }
}

impl Artifacts {
    /// Bytes that are free on the disk of the data folder.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Io`].
    pub fn free_bytes(&self) -> Result<u64, ArtifactError> {
        free_bytes(&self.inner.data_dir)
    }

    /// What new work must leave free.
    #[must_use]
    pub fn space_limits(&self) -> SpaceLimits {
        self.inner.space.limits
    }

    /// Tells how many bytes all recorded artifacts have; the store knows.
    pub fn set_stored_bytes(&self, bytes: u64) {
        self.inner.space.stored_bytes.store(bytes, Ordering::Relaxed);
    }

    /// Whether a job that starts now may hope to end: half of the reserve is left for those that run.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`].
    pub fn room_to_start(&self) -> Result<(), ArtifactError> {
        let reserve_bytes = self.inner.space.limits.reserve_bytes;
        if reserve_bytes == 0 {
            return Ok(());
        }
        match self.free_bytes()? {
            free_bytes if free_bytes < reserve_bytes / 2 => Err(ArtifactError::DiskLow { free_bytes, reserve_bytes }),
            _ => Ok(()),
        }
    }

    /// Whether `more_bytes` of new work may be taken.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`] where the reserve would be used; [`ArtifactError::QuotaSpent`] where all artifacts
    /// together would have too many bytes.
    pub fn admit(&self, more_bytes: u64) -> Result<(), ArtifactError> {
        let SpaceLimits { reserve_bytes, stored_bytes_max } = self.inner.space.limits;
        if reserve_bytes > 0 {
            let free_bytes = self.free_bytes()?;
            if free_bytes < reserve_bytes.saturating_add(more_bytes) {
                return Err(ArtifactError::DiskLow { free_bytes, reserve_bytes });
            }
        }
        let stored_bytes = self.inner.space.stored_bytes.load(Ordering::Relaxed);
        if stored_bytes_max > 0 && more_bytes > 0 && stored_bytes.saturating_add(more_bytes) > stored_bytes_max {
            return Err(ArtifactError::QuotaSpent { stored_bytes, stored_bytes_max });
        }
        Ok(())
    }
}

fn free_bytes(path: &Path) -> Result<u64, ArtifactError> {
    let disk = statvfs(path).map_err(|error| ArtifactError::io("ask for the free space of", error.into()))?;
    // What this user may use, not what only the administrator may.
    Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
}
