//! Storing a blob and recording it: the only order in which no process that shares the bucket removes the blob again.

use crate::error::ArtifactError;
use crate::inventory::BlobKind;
use crate::{Artifacts, UploadWriter};

impl Artifacts {
    /// Stores `bytes` and records them with `record`, which gets their digest, and the mark of a removal that it may end.
    /// While the blob is being removed, `record` records nothing and returns the mark of the removal as the inner error;
    /// then it is called again, after another copy was stored. When this returns, the blob is on disk, in the bucket if
    /// there is one, and recorded.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskFull`], [`ArtifactError::Io`], [`ArtifactError::Remote`]; the errors of `record`.
    pub async fn publish_bytes<T, E, R>(
        &self,
        bytes: Vec<u8>,
        record: impl Fn(String, Option<String>) -> R,
    ) -> Result<T, E>
    where
        E: From<ArtifactError>,
        R: Future<Output = Result<Result<T, String>, E>>,
    {
        self.publish(self.put_bytes(bytes), record).await
    }

    /// Does the same as [`Self::publish_bytes`] with the bytes of an upload.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::publish_bytes`]; [`ArtifactError::WrongSize`], [`ArtifactError::WrongDigest`].
    pub async fn publish_upload<T, E, R>(
        &self,
        upload: UploadWriter,
        record: impl Fn(String, Option<String>) -> R,
    ) -> Result<T, E>
    where
        E: From<ArtifactError>,
        R: Future<Output = Result<Result<T, String>, E>>,
    {
        self.publish(upload.finish(), record).await
    }

    /// Stores a blob with `store`, records it, and makes sure that no removal has taken it in the meantime: the second
    /// and the third rule in `remote_calls`.
    async fn publish<T, E, R>(
        &self,
        store: impl Future<Output = Result<String, ArtifactError>>,
        record: impl Fn(String, Option<String>) -> R,
    ) -> Result<T, E>
    where
        E: From<ArtifactError>,
        R: Future<Output = Result<Result<T, String>, E>>,
    {
        let _publishing = self.publishing().await;
        let (digest, mut seen) = (store.await?, None);
        loop {
            match record(digest.clone(), seen).await? {
                Ok(recorded) => {
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
