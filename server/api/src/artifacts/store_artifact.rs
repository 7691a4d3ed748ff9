//! Storing artifacts that the server made.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use lightpath_store::ArtifactRecord;

impl Api {
    /// Stores bytes as an artifact owned by the caller, and returns its digest. Empty bytes are not stored; their
    /// digest is an empty text.
    pub(crate) async fn store_artifact(&self, call: &Call, bytes: Vec<u8>) -> Result<String, ApiError> {
        if bytes.is_empty() {
            return Ok(String::new());
        }
        let size_bytes = bytes.len() as u64;
        let record = async |digest: String, seen| self.record(call, &digest, size_bytes, seen).await;
        Ok(self.artifacts.publish(bytes, record).await?.digest)
    }

    /// Records an artifact of the caller that is stored; the inner error is the mark of a removal.
    pub(super) async fn record(
        &self,
        call: &Call,
        digest: &str,
        size_bytes: u64,
        seen: Option<String>,
    ) -> Result<Result<ArtifactRecord, String>, ApiError> {
        call.concerns(digest);
        Ok(self
            .store
            .record_artifact(digest, size_bytes, &call.caller.name, seen.as_deref(), self.store.now_ms())
            .await?)
    }
}
