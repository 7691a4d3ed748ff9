//! Storing what the server made as an artifact.

use crate::api::Api;
use crate::error::ApiError;
use crate::time::now_ms;
use lightpath_domain::access::Caller;

impl Api {
    /// Stores bytes as an artifact that the caller uploaded, and returns its digest; empty bytes are not stored, and have
    /// an empty digest.
    pub(crate) async fn keep(&self, caller: &Caller, bytes: Vec<u8>) -> Result<String, ApiError> {
        if bytes.is_empty() {
            return Ok(String::new());
        }
        let size_bytes = bytes.len() as u64;
        let _publishing = self.artifacts.publishing().await;
        let digest = self.artifacts.put_bytes(bytes).await?;
        self.store.record_artifact(&digest, size_bytes, &caller.name, now_ms()).await?;
        Ok(digest)
    }
}
