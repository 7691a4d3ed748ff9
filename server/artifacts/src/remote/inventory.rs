//! Read access to the blobs of a bucket, for checks while servers may be using it.

use super::options::RemoteOptions;
use super::{Remote, identity};
use crate::blocking::blocking;
use crate::error::Result;
use crate::inventory::BlobKind;
use std::sync::Arc;

/// The blobs of a bucket. Nothing is written to it.
#[derive(Clone, Debug)]
pub struct BucketInventory {
    remote: Arc<Remote>,
}

impl BucketInventory {
    /// Connects to a bucket that a server has used.
    ///
    /// # Errors
    ///
    /// [`crate::ArtifactError::BadRemote`]; [`crate::ArtifactError::UnfitRemote`] if no server has used the bucket.
    pub async fn open(options: &RemoteOptions) -> Result<Self> {
        let options = options.clone();
        blocking(move || {
            let (store, prefix) = options.connect()?;
            let mut remote = Remote::unnamed(Arc::new(store), prefix)?;
            remote.installation = identity::named(&remote)?;
            Ok(Self { remote: Arc::new(remote) })
        })
        .await
    }

    /// Name of the installation to which the blobs belong.
    #[must_use]
    pub fn installation(&self) -> &str {
        self.remote.installation()
    }

    /// Digests of all blobs of a kind.
    pub async fn list(&self, kind: BlobKind) -> Result<Vec<String>> {
        let remote = Arc::clone(&self.remote);
        blocking(move || {
            let shards = (0..=u8::MAX).map(|shard| remote.stored(kind, shard));
            Ok(shards.collect::<Result<Vec<_>, _>>()?.concat())
        })
        .await
    }

    /// Reads the copies of a blob until one matches the digest, and returns its size \[bytes\].
    ///
    /// # Errors
    ///
    /// [`crate::ArtifactError::NotFound`] if there is no copy; [`crate::ArtifactError::DataLoss`] if no copy matches
    /// the digest.
    pub async fn verify(&self, kind: BlobKind, digest: &str) -> Result<u64> {
        let (remote, digest) = (Arc::clone(&self.remote), digest.to_owned());
        blocking(move || remote.verify(kind, &digest)).await
    }
}
