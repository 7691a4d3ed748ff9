//! Limits on disk space: a reserve that only accepted work may use, and a limit on the size of all artifacts.
//!
//! New bytes are claimed before they are written (`claim`). At any time the free space is at least the reserve
//! and all bytes that are claimed and not yet written, as far as nobody but claimants writes. If room is missing, files
//! that can be made again go first, then local copies of what is in the remote, and then interrupted uploads, the oldest
//! before the others.

use crate::conversions::Conversions;
use crate::error::{ArtifactError, Result};
use crate::interrupted::Interrupted;
use crate::remote::cache::Cache;
use rustix::fs::statvfs;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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
    claims: Mutex<Claims>,
    interrupted: Interrupted,
    conversions: Arc<Conversions>,
    /// Local copies of blobs in the remote, if there is one.
    cache: Option<Arc<Cache>>,
}

/// Sums of all claims.
#[derive(Debug, Default)]
pub(crate) struct Claims {
    /// Bytes that are not yet on the disk.
    pub(crate) unwritten_bytes: u64,
    /// Bytes that will count as stored.
    counted_bytes: u64,
    /// The same by owner, without owners who have none.
    by_owner: HashMap<String, u64>,
}

impl Claims {
    /// Adds a claim, and returns the sum of the owner's claims \[bytes\].
    fn add(&mut self, owner: &str, counted_bytes: u64, unwritten_bytes: u64) -> u64 {
        self.unwritten_bytes += unwritten_bytes;
        self.counted_bytes += counted_bytes;
        let of_owner = self.by_owner.entry(owner.to_owned()).or_default();
        *of_owner += counted_bytes;
        *of_owner
    }

    pub(crate) fn release(&mut self, owner: &str, counted_bytes: u64) {
        self.counted_bytes -= counted_bytes;
        if let Some(of_owner) = self.by_owner.get_mut(owner) {
            *of_owner -= counted_bytes;
            if *of_owner == 0 {
                self.by_owner.remove(owner);
            }
        }
    }
}

impl Space {
    pub(crate) fn new(
        limits: SpaceLimits,
        data_dir: PathBuf,
        interrupted: Interrupted,
        conversions: Arc<Conversions>,
        cache: Option<Arc<Cache>>,
    ) -> Self {
        let (stored_bytes, claims) = (AtomicU64::new(0), Mutex::default());
        Self { limits, stored_bytes, data_dir, claims, interrupted, conversions, cache }
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
        self.require_free(self.limits.reserve_bytes / 2)
    }

    /// Checks that a checkpoint of this size may be written. A part of the reserve must stay free: half of it is left
    /// to the results of the running jobs.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`].
    pub fn room_for_checkpoint(&self, bytes: u64) -> Result<()> {
        self.require_free((self.limits.reserve_bytes / 2).saturating_add(bytes))
    }

    /// Checks that new work may be accepted, which stores nothing yet: the reserve must be free.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`].
    pub fn room_for_new_work(&self) -> Result<()> {
        self.require_free(self.limits.reserve_bytes)
    }

    /// Adds a claim if there is room for it beside `reserve_bytes`, and returns the sum of the owner's claims \[bytes\].
    pub(crate) fn add_claim(
        &self,
        reserve_bytes: u64,
        owner: &str,
        counted_bytes: u64,
        unwritten_bytes: u64,
    ) -> Result<u64> {
        let mut claims = self.claims();
        // The disk comes last: a claim that is refused anyway makes no room there.
        self.require_within_limit(claims.counted_bytes, counted_bytes)?;
        self.require_beside(reserve_bytes, claims.unwritten_bytes.saturating_add(unwritten_bytes))?;
        Ok(claims.add(owner, counted_bytes, unwritten_bytes))
    }

    /// Checks that all claimed bytes still fit beside `reserve_bytes`.
    pub(crate) fn require_claimed(&self, reserve_bytes: u64) -> Result<()> {
        let unwritten_bytes = self.claims().unwritten_bytes;
        self.require_beside(reserve_bytes, unwritten_bytes)
    }

    pub(crate) fn change_claims(&self, change: impl FnOnce(&mut Claims)) {
        change(&mut self.claims());
    }

    pub(crate) fn add_stored_bytes(&self, bytes: u64) {
        self.stored_bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(crate) fn interrupted(&self) -> &Interrupted {
        &self.interrupted
    }

    /// Checks the free space for accepted work, which may use the reserve.
    fn require_free(&self, needed_bytes: u64) -> Result<()> {
        let reserve_bytes = self.limits.reserve_bytes;
        if reserve_bytes == 0 {
            return Ok(());
        }
        match self.free_with_room_for(needed_bytes)? {
            free_bytes if free_bytes < needed_bytes => {
                Err(ArtifactError::DiskLow { free_bytes, reserve_bytes, claimed_bytes: 0 })
            }
            _ => Ok(()),
        }
    }

    /// Checks that `claimed_bytes` fit beside `reserve_bytes`.
    fn require_beside(&self, reserve_bytes: u64, claimed_bytes: u64) -> Result<()> {
        let needed_bytes = reserve_bytes.saturating_add(claimed_bytes);
        match self.free_with_room_for(needed_bytes)? {
            free_bytes if free_bytes >= needed_bytes => Ok(()),
            _ if reserve_bytes == 0 => Err(ArtifactError::DiskFull),
            free_bytes => Err(ArtifactError::DiskLow { free_bytes, reserve_bytes, claimed_bytes }),
        }
    }

    /// Checks that `more_bytes` beside `claimed_bytes` keep the limit on all artifacts. Interrupted uploads count, too.
    fn require_within_limit(&self, claimed_bytes: u64, more_bytes: u64) -> Result<()> {
        let stored_bytes_max = self.limits.stored_bytes_max;
        if stored_bytes_max == 0 || more_bytes == 0 {
            return Ok(());
        }
        let stored_bytes = self.stored_bytes.load(Ordering::Relaxed).saturating_add(claimed_bytes);
        let left_bytes = stored_bytes_max.saturating_sub(stored_bytes);
        if more_bytes > left_bytes {
            return Err(ArtifactError::QuotaSpent { stored_bytes, stored_bytes_max });
        }
        while self.interrupted.bytes() > left_bytes - more_bytes && self.interrupted.remove_one() {}
        Ok(())
    }

    /// Free space \[bytes\]. Before that, if less than `needed_bytes` are free, removes files that can be made or fetched
    /// again and interrupted uploads, if their room is enough.
    fn free_with_room_for(&self, needed_bytes: u64) -> Result<u64> {
        let mut free_bytes = self.free_bytes()?;
        if free_bytes >= needed_bytes {
            return Ok(free_bytes);
        }
        let cached_bytes = self.cache.as_ref().map_or(0, |cache| cache.bytes());
        let removable_bytes =
            self.conversions.bytes().saturating_add(cached_bytes).saturating_add(self.interrupted.bytes());
        if free_bytes.saturating_add(removable_bytes) >= needed_bytes {
            self.conversions.make_room(needed_bytes - free_bytes);
            free_bytes = self.free_bytes()?;
            if let Some(cache) = &self.cache {
                while free_bytes < needed_bytes && cache.remove_oldest()? {
                    free_bytes = self.free_bytes()?;
                }
            }
            while free_bytes < needed_bytes && self.interrupted.remove_one() {
                free_bytes = self.free_bytes()?;
            }
        }
        Ok(free_bytes)
    }

    fn claims(&self) -> MutexGuard<'_, Claims> {
        // The sums are consistent even after a panic: each change of them only adds and subtracts.
        self.claims.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
