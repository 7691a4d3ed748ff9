//! What processes that share a remote do beyond reading and writing.
//!
//! A blob is removed by a process while another may store the same bytes. Nothing is lost if all keep three rules; a row
//! is the record of a blob in the store, which all of them share. (The store keeps a row with a mark in a table of its own,
//! so that nobody takes it for the record of a blob that is there.)
//!
//! 1. A collector reads the row's mark, lists the objects ([`Artifacts::objects_of`]), gives the row a mark that was never used
//!    before if nothing uses the row and its mark is still the one read, removes the listed objects
//!    ([`Artifacts::delete_objects`]), and then the row if it still has the new mark.
//! 2. A publisher stores the blob, then records it. If the row has a mark, it stores another copy
//!    ([`Artifacts::store_anew`]) and records again, which clears the mark if it is still the one it has seen.
//! 3. A publisher calls [`Artifacts::ensure_stored`] after it has recorded the blob and before it answers.
//!
//! [`Artifacts::publish`] keeps the second and the third rule.
//!
//! Without a remote, the functions find and change nothing.

use crate::error::Result;
use crate::inventory::BlobKind;
use crate::remote::RemoteObject;
use crate::{Artifacts, Inner};

impl Artifacts {
    /// The copies of a blob in the remote.
    pub async fn objects_of(&self, kind: BlobKind, digest: &str) -> Result<Vec<RemoteObject>> {
        let digest = digest.to_owned();
        self.blocking(move |inner| match &inner.remote {
            Some(remote) => remote.objects(kind, &digest),
            None => Ok(Vec::new()),
        })
        .await
    }

    /// Removes listed copies of a blob from the remote, and nothing else. A missing copy is no error. The local file
    /// stays: a publisher in this process may need it for [`Self::store_anew`].
    pub async fn delete_objects(&self, kind: BlobKind, digest: &str, listed: Vec<RemoteObject>) -> Result<()> {
        let digest = digest.to_owned();
        self.blocking(move |inner| match &inner.remote {
            Some(remote) => remote.delete(kind, &digest, &listed),
            None => Ok(()),
        })
        .await
    }

    /// Stores another copy of a blob in the remote, from the local file, even if the remote has one.
    ///
    /// # Errors
    ///
    /// [`crate::ArtifactError::Remote`] also if the local file is gone: then the bytes must be sent again.
    pub async fn store_anew(&self, kind: BlobKind, digest: &str) -> Result<()> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.of(kind).store_anew(&digest)).await
    }

    /// Stores a copy of a blob in the remote, from the local file, if the remote has none.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::store_anew`].
    pub async fn ensure_stored(&self, kind: BlobKind, digest: &str) -> Result<()> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.of(kind).ensure_stored(&digest)).await
    }

    /// Digests of the blobs in the remote whose digest begins with the byte `shard`, in their order.
    pub async fn stored(&self, kind: BlobKind, shard: u8) -> Result<Vec<String>> {
        self.blocking(move |inner| match &inner.remote {
            Some(remote) => remote.stored(kind, shard),
            None => Ok(Vec::new()),
        })
        .await
    }

    /// Reads the copies of a blob in the remote until one matches the digest, and returns its size \[bytes\]; `None`
    /// without a remote.
    ///
    /// # Errors
    ///
    /// [`crate::ArtifactError::NotFound`] if the remote has no copy; [`crate::ArtifactError::DataLoss`] if no copy
    /// matches the digest.
    pub async fn verify(&self, kind: BlobKind, digest: &str) -> Result<Option<u64>> {
        let digest = digest.to_owned();
        self.blocking(move |inner| match &inner.remote {
            Some(remote) => remote.verify(kind, &digest).map(Some),
            None => Ok(None),
        })
        .await
    }
}

impl Inner {
    fn of(&self, kind: BlobKind) -> &crate::blobs::Blobs {
        match kind {
            BlobKind::Artifact => &self.blobs,
            BlobKind::Checkpoint => &self.checkpoints,
        }
    }
}
