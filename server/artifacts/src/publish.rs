//! Storing a blob and recording it: the only order in which no process that shares the bucket removes the blob again.

use crate::error::ArtifactError;
use crate::inventory::BlobKind;
use crate::upload::UploadLock;
use crate::{Artifacts, UploadWriter};

/// What is to be published.
#[derive(Debug)]
pub enum Content {
    /// Bytes in memory.
    Bytes(Vec<u8>),
    /// The bytes of an upload.
    Upload(Box<UploadWriter>),
}

impl From<Vec<u8>> for Content {
    fn from(bytes: Vec<u8>) -> Self {
        Self::Bytes(bytes)
    }
}

impl From<UploadWriter> for Content {
    fn from(upload: UploadWriter) -> Self {
        Self::Upload(Box::new(upload))
    }
}

impl Artifacts {
    /// Stores the content and records it with `record`, which gets its digest, and the mark of a removal that it may end.
    /// While the blob is being removed, `record` records nothing and returns the mark of the removal as the inner error;
    /// then it is called again, after another copy was stored. When this returns, the blob is on disk, in the bucket if
    /// there is one, recorded, and no removal has taken it in the meantime: the second and the third rule in
    /// `remote_calls`.
    ///
    /// # Errors
    ///
    /// Of an upload, [`ArtifactError::WrongSize`] and [`ArtifactError::WrongDigest`]; the errors of `record`.
    pub async fn publish<T, E, R>(
        &self,
        content: impl Into<Content>,
        record: impl Fn(String, Option<String>) -> R,
    ) -> Result<T, E>
    where
        E: From<ArtifactError>,
        R: Future<Output = Result<Result<T, String>, E>>,
    {
        let _publishing = self.publishing().await?;
        let (digest, upload) = match content.into() {
            Content::Bytes(bytes) => (self.put_bytes(bytes).await?, None),
            // The lock holds the room of the upload until the store counts it.
            Content::Upload(upload) => upload.finish_claimed().await.map(|(digest, lock)| (digest, Some(lock)))?,
        };
        let mut seen = None;
        loop {
            match record(digest.clone(), seen).await? {
                Ok(recorded) => {
                    if let Some(claim) = upload.as_ref().and_then(UploadLock::claim) {
                        claim.recorded();
                    }
                    self.ensure_stored(BlobKind::Artifact, &digest).await?;
                    return Ok(recorded);
                }
                Err(mark) => {
                    self.store_anew(BlobKind::Artifact, &digest).await?;
                    seen = Some(mark);
                }
            }
        }
    }
}
