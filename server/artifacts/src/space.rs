//! Limits on disk space: a reserve that only accepted work may use, and a limit on the size of all artifacts.

use crate::error::{ArtifactError, Result};
use rustix::fs::statvfs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// Limits on the space that new uploads and jobs may use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SpaceLimits {
    /// Free space that only accepted work may use \[bytes\].
    pub reserve_bytes: u64,
    /// Limit on the size of all artifacts together \[bytes\]; 0: no limit.
    pub stored_bytes_max: u64,
}

/// The disk of the data folder, and the limits on its use.
#[derive(Debug)]
pub struct Space {
    limits: SpaceLimits,
    stored_bytes: AtomicU64,
    data_dir: PathBuf,
}

impl Space {
    pub(crate) fn new(limits: SpaceLimits, data_dir: PathBuf) -> Self {
        Self { limits, stored_bytes: AtomicU64::new(0), data_dir }
    }

    /// Free space on the disk, without the space that the system keeps for its administrator \[bytes\].
    pub fn free_bytes(&self) -> Result<u64> {
        let disk = statvfs(&self.data_dir)
            .map_err(|error| ArtifactError::io("read the free space of the disk", error.into()))?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// The limits on the space that new work may use.
    #[must_use]
    pub fn limits(&self) -> SpaceLimits {
        self.limits
    }

    /// Sets the size of all recorded artifacts \[bytes\], which only the store knows.
    pub fn set_stored_bytes(&self, bytes: u64) {
        self.stored_bytes.store(bytes, Ordering::Relaxed);
    }

    /// Checks that a job may start. Half of the reserve must be free; the other half is left to the running jobs.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`].
    pub fn room_to_start(&self) -> Result<()> {
        let reserve_bytes = self.limits.reserve_bytes;
        if reserve_bytes == 0 {
            return Ok(());
        }
        match self.free_bytes()? {
            free_bytes if free_bytes < reserve_bytes / 2 => Err(ArtifactError::DiskLow { free_bytes, reserve_bytes }),
            _ => Ok(()),
        }
    }

    /// Checks that a checkpoint of this size may be written. A part of the reserve must stay free: half of it is left
    /// to the results of the running jobs.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`].
    pub fn room_for_checkpoint(&self, bytes: u64) -> Result<()> {
        let reserve_bytes = self.limits.reserve_bytes;
        if reserve_bytes == 0 {
            return Ok(());
        }
        match self.free_bytes()? {
            free_bytes if free_bytes < (reserve_bytes / 2).saturating_add(bytes) => {
                Err(ArtifactError::DiskLow { free_bytes, reserve_bytes })
            }
            _ => Ok(()),
        }
    }

    /// Checks that `more_bytes` of new work may be accepted.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`] if the work would use the reserve; [`ArtifactError::QuotaSpent`] if the size of all
    /// artifacts would exceed its limit.
    pub fn admit(&self, more_bytes: u64) -> Result<()> {
        self.admit_temporary(more_bytes)?;
        let stored_bytes_max = self.limits.stored_bytes_max;
        let stored_bytes = self.stored_bytes.load(Ordering::Relaxed);
        if stored_bytes_max > 0 && more_bytes > 0 && stored_bytes.saturating_add(more_bytes) > stored_bytes_max {
            return Err(ArtifactError::QuotaSpent { stored_bytes, stored_bytes_max });
        }
        Ok(())
    }

    /// Checks that `more_bytes` fit beside the reserve. Temporary files do not count towards the size of all artifacts.
    pub(crate) fn admit_temporary(&self, more_bytes: u64) -> Result<()> {
        let reserve_bytes = self.limits.reserve_bytes;
        if reserve_bytes == 0 {
            return Ok(());
        }
        match self.free_bytes()? {
            free_bytes if free_bytes < reserve_bytes.saturating_add(more_bytes) => {
                Err(ArtifactError::DiskLow { free_bytes, reserve_bytes })
            }
            _ => Ok(()),
        }
    }
}
