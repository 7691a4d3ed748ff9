//! Storing artifacts that the server made.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;

impl Api {
    /// Stores bytes as an artifact owned by the caller, and returns its digest. Empty bytes are not stored; their
    /// digest is an empty text.
    pub(crate) async fn store_artifact(&self, call: &Call, bytes: Vec<u8>) -> Result<String, ApiError> {
        if bytes.is_empty() {
            return Ok(String::new());
        }
        let size_bytes = bytes.len() as u64;
        let _publishing = self.artifacts.publishing().await;
        let digest = self.artifacts.put_bytes(bytes).await?;
        call.concerns(&digest);
        self.store.record_artifact(&digest, size_bytes, &call.caller.name, self.store.now_ms()).await?;
        Ok(digest)
    }
}
