//! Which artifacts a caller may read.

use super::Files;
use crate::call::Call;
use crate::error::Result;
use lightpath_store::ArtifactRecord;

impl Files {
    /// The record of an artifact; `None` if it is not stored or the caller may not read it. A caller whose token is for
    /// some displays may only read artifacts of these displays and artifacts that the caller uploaded.
    pub async fn readable(&self, call: &Call, digest: &str) -> Result<Option<ArtifactRecord>> {
        let Some(record) = self.store.artifact(digest).await? else { return Ok(None) };
        if call.caller.displays.is_empty() {
            return Ok(Some(record));
        }
        let concerns = self.store.artifact_concerns(digest, &call.caller.name, &call.caller.displays).await?;
        Ok(concerns.then_some(record))
    }

    /// The record of an artifact that the caller is about to use; `None` if it is not stored or the caller may not read
    /// it. The time of use is updated, so that the artifact is not removed soon.
    pub async fn in_use(&self, call: &Call, digest: &str) -> Result<Option<ArtifactRecord>> {
        match self.readable(call, digest).await? {
            Some(_) => Ok(self.store.use_artifact(digest, self.store.now_ms()).await?),
            None => Ok(None),
        }
    }

    /// The record of an artifact whose bytes the caller offers; `None` if the server needs the bytes: the artifact is
    /// not stored, the caller may not read it, or its file is missing or damaged.
    pub async fn intact(&self, call: &Call, digest: &str) -> Result<Option<ArtifactRecord>> {
        let Some(record) = self.in_use(call, digest).await? else { return Ok(None) };
        if self.artifacts.is_intact(digest).await? {
            return Ok(Some(record));
        }
        tracing::warn!(digest, "a stored artifact is missing or damaged; the upload that a client offers repairs it");
        Ok(None)
    }
}
