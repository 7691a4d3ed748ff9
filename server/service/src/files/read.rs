//! Reading artifacts.

use super::Files;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_artifacts::{ArtifactReader, CHUNK_BYTES};
use lightpath_store::ArtifactRecord;

impl Files {
    /// The record of an artifact that the caller reads. Refuses one that the caller may not read as one that does not
    /// exist.
    pub async fn existing(&self, call: &Call, field: &Field, digest: &str) -> Result<ArtifactRecord> {
        let missing = || field.missing(format!("artifact {digest}"), "use a digest from the result of a job");
        self.readable(call, digest).await?.ok_or_else(missing)
    }

    /// A reader of at most `limit_bytes` (0: all) of an artifact from `offset_bytes` on. The whole file is compared
    /// with its digest first, which takes a second for each gigabyte.
    pub async fn reader(
        &self,
        call: &Call,
        digest: &str,
        (offset_bytes, limit_bytes): (u64, u64),
    ) -> Result<ArtifactReader> {
        let (artifacts, digest) = (self.artifacts.clone(), digest.to_owned());
        let open = move || artifacts.read_range_blocking(&digest, offset_bytes, limit_bytes);
        Ok(self.computing.run(call, CHUNK_BYTES as u64, open).await??)
    }
}
