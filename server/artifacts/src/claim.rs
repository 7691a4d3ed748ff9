//! Room that is claimed before bytes are written, so that callers side by side cannot use the same room twice.

use crate::error::Result;
use crate::space::Space;
use std::sync::Arc;

/// Room for bytes that are about to be stored for an owner. Dropping it gives the room back; what was recorded then
/// counts as stored.
#[derive(Debug)]
pub struct Claim {
    space: Arc<Space>,
    owner: String,
    /// Bytes that count towards the limits on what is stored.
    counted_bytes: u64,
    /// Bytes that will still be written to the disk.
    unwritten_bytes: u64,
    /// What the owner had claimed when this claim was made, and this claim \[bytes\].
    owner_claimed_bytes: u64,
    /// Bytes of the disk that stay free beside all claims.
    reserve_bytes: u64,
}

impl Claim {
    /// Claims room for bytes that are about to be written: `unwritten_bytes` on the disk, of which `counted_bytes` count
    /// as stored by the owner.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`] and [`ArtifactError::DiskFull`] if they would use the reserve, or what others have
    /// claimed; [`ArtifactError::QuotaSpent`] if the size of all artifacts would exceed its limit.
    ///
    /// [`ArtifactError::DiskLow`]: crate::ArtifactError::DiskLow
    /// [`ArtifactError::DiskFull`]: crate::ArtifactError::DiskFull
    /// [`ArtifactError::QuotaSpent`]: crate::ArtifactError::QuotaSpent
    pub fn take(space: &Arc<Space>, owner: &str, counted_bytes: u64, unwritten_bytes: u64) -> Result<Self> {
        Self::beside(space.limits().reserve_bytes, space, owner, counted_bytes, unwritten_bytes)
    }

    /// Claims room for a local copy of a blob that is recorded and kept in the remote. Running jobs read what they need
    /// through such copies, so that the copies may use a half of the reserve. The other half is left to results.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`] and [`ArtifactError::DiskFull`] if the copy would use the other half, or what others
    /// have claimed.
    ///
    /// [`ArtifactError::DiskLow`]: crate::ArtifactError::DiskLow
    /// [`ArtifactError::DiskFull`]: crate::ArtifactError::DiskFull
    pub(crate) fn for_copy(space: &Arc<Space>, size_bytes: u64) -> Result<Self> {
        Self::beside(space.limits().reserve_bytes / 2, space, "", 0, size_bytes)
    }

    fn beside(
        reserve_bytes: u64,
        space: &Arc<Space>,
        owner: &str,
        counted_bytes: u64,
        unwritten_bytes: u64,
    ) -> Result<Self> {
        let owner_claimed_bytes = space.add_claim(reserve_bytes, owner, counted_bytes, unwritten_bytes)?;
        let (space, owner) = (Arc::clone(space), owner.to_owned());
        Ok(Self { space, owner, counted_bytes, unwritten_bytes, owner_claimed_bytes, reserve_bytes })
    }

    /// Bytes that must fit into what the owner may store: this claim, the claims that the owner had before, and the
    /// owner's interrupted uploads. 0 for a claim that stores nothing new.
    #[must_use]
    pub fn owner_bytes(&self) -> u64 {
        match self.counted_bytes {
            0 => 0,
            _ => self.owner_claimed_bytes.saturating_add(self.space.interrupted().bytes_of(&self.owner)),
        }
    }

    /// The same without the interrupted uploads, which make room for others.
    #[must_use]
    pub fn owner_bytes_at_least(&self) -> u64 {
        if self.counted_bytes == 0 { 0 } else { self.owner_claimed_bytes }
    }

    /// Removes the oldest interrupted upload of the owner; `false` if there is none.
    #[must_use]
    pub fn remove_interrupted(&self) -> bool {
        self.space.interrupted().remove_one_of(&self.owner)
    }

    /// Checks that the claimed bytes still fit: others than claimants may have filled the disk in the meantime.
    pub(crate) fn require_disk(&self) -> Result<()> {
        self.space.require_claimed(self.reserve_bytes)
    }

    /// Notes that bytes are on the disk.
    pub(crate) fn wrote(&mut self, bytes: u64) {
        let written_bytes = bytes.min(self.unwritten_bytes);
        self.unwritten_bytes -= written_bytes;
        self.space.change_claims(|claims| claims.unwritten_bytes -= written_bytes);
    }

    /// Notes that the bytes are stored and recorded. They count as stored from now on, before the store is asked again.
    pub fn recorded(&self) {
        self.space.add_stored_bytes(self.counted_bytes);
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.space.change_claims(|claims| {
            claims.unwritten_bytes -= self.unwritten_bytes;
            claims.release(&self.owner, self.counted_bytes);
        });
    }
}
