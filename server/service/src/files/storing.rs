//! Storing artifacts that the server made.

use super::Files;
use crate::call::Call;
use crate::error::Result;
use lightpath_store::ArtifactRecord;

impl Files {
    /// Stores bytes as an artifact owned by the caller, and returns its digest. Empty bytes are not stored; their
    /// digest is an empty text. They need the same room as an upload.
    pub async fn store(&self, call: &Call, bytes: Vec<u8>) -> Result<String> {
        if bytes.is_empty() {
            return Ok(String::new());
        }
        let (digest, bytes) = self.artifacts.digest_of(bytes).await?;
        if let Some(stored) = self.intact(call, &digest).await? {
            call.concerns(&stored.digest);
            return Ok(stored.digest);
        }
        let size_bytes = bytes.len() as u64;
        self.require_room_to_ask(call, size_bytes).await?;
        let claim = self.artifacts.claim(&call.caller.name, size_bytes).await?;
        self.require_owner_room(call, &claim).await?;
        let record = async |digest: String, seen| self.record(call, &digest, size_bytes, seen).await;
        let digest = self.artifacts.publish(bytes, record).await?.digest;
        claim.recorded();
        Ok(digest)
    }

    /// Records an artifact of the caller that is stored; the inner error is the mark of a removal.
    pub(super) async fn record(
        &self,
        call: &Call,
        digest: &str,
        size_bytes: u64,
        seen: Option<String>,
    ) -> Result<Result<ArtifactRecord, String>> {
        call.concerns(digest);
        Ok(self
            .store
            .record_artifact(digest, size_bytes, &call.caller.name, seen.as_deref(), self.store.now_ms())
            .await?)
    }
}
