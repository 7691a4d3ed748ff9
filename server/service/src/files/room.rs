//! Room of owners for what they store.

use super::Files;
use crate::call::Call;
use crate::error::Result;
use lightpath_artifacts::Claim;
use lightpath_store::StoreError;

impl Files {
    /// Checks that the caller may store the claimed bytes beside what the caller has stored, and beside the caller's other
    /// uploads. The caller's interrupted uploads make room, the oldest before the others.
    pub(super) async fn require_owner_room(&self, call: &Call, claim: &Claim) -> Result<()> {
        let room = async |bytes| self.store.require_owner_room(&call.caller.name, bytes, self.owner_bytes_max).await;
        // If even their removal is not enough, they stay.
        room(claim.owner_bytes_at_least()).await?;
        loop {
            match room(claim.owner_bytes()).await {
                Err(StoreError::OwnerBytes { .. }) if claim.remove_interrupted() => {}
                checked => return Ok(checked?),
            }
        }
    }

    /// Checks, before room is claimed, that the caller may store so many more bytes: a claim may remove interrupted uploads
    /// of others.
    pub(super) async fn require_room_to_ask(&self, call: &Call, bytes: u64) -> Result<()> {
        Ok(self.store.require_owner_room(&call.caller.name, bytes, self.owner_bytes_max).await?)
    }
}
