//! Finding artifacts that the caller may use.

use crate::api::Api;
use crate::error::ApiError;
use crate::time::now_ms;
use lightpath_domain::access::Caller;
use lightpath_store::ArtifactRecord;

impl Api {
    /// An artifact's record, where it is stored and the caller may read it. A token that is for some displays only reads
    /// the artifacts of those displays, and those that it uploaded itself; all others do not exist for it.
    pub(crate) async fn artifact_for_caller(
        &self,
        caller: &Caller,
        digest: &str,
    ) -> Result<Option<ArtifactRecord>, ApiError> {
        let Some(record) = self.store.artifact(digest).await? else { return Ok(None) };
        if caller.displays.is_empty() {
            return Ok(Some(record));
        }
        let concerns = self.store.artifact_concerns(digest, &caller.name, &caller.displays).await?;
        Ok(concerns.then_some(record))
    }

    /// The same for a caller who goes on to use it: it counts as used now, so that it is not collected soon.
    pub(crate) async fn artifact_in_use(
        &self,
        caller: &Caller,
        digest: &str,
    ) -> Result<Option<ArtifactRecord>, ApiError> {
        match self.artifact_for_caller(caller, digest).await? {
            Some(_) => Ok(self.store.use_artifact(digest, now_ms()).await?),
            None => Ok(None),
        }
    }
}
