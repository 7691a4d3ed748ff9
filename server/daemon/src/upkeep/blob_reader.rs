//! Reads the blobs of an installation for a check: in the data folder, or in a bucket.

use super::Result;
use crate::database::DatabaseError;
use lightpath_artifacts::{ArtifactError, BlobKind, BucketInventory, Inventory, RemoteOptions};
use lightpath_store::Inspection;
use std::collections::HashSet;
use std::io;
use std::path::Path;

/// The blobs of an installation.
#[derive(Debug)]
pub(super) enum BlobReader {
    Folder(Inventory),
    Bucket(BucketInventory),
}

impl BlobReader {
    pub(super) async fn open(data_dir: &Path, bucket: Option<&RemoteOptions>) -> Result<Self> {
        match bucket {
            Some(options) => Ok(Self::Bucket(BucketInventory::open(options).await?)),
            None => Ok(Self::Folder(Inventory::of(data_dir))),
        }
    }

    /// Refuses a database that belongs to other artifacts: each of them would seem to be missing.
    pub(super) async fn require(&self, inspection: &mut Inspection) -> Result<()> {
        let Some(recorded) = inspection.artifact_place().await? else { return Ok(()) };
        let found = match self {
            Self::Folder(inventory) => inventory.identity()?.unwrap_or_else(|| "none".to_owned()),
            Self::Bucket(inventory) => inventory.installation().to_owned(),
        };
        if recorded == found { Ok(()) } else { Err(DatabaseError::OtherArtifacts { recorded, found }.into()) }
    }

    /// Whether it is an artifact, and the digest, of all blobs that exist before the rows are read. Those that remain
    /// in the set after the check are unreferenced.
    pub(super) async fn blobs(&self) -> Result<HashSet<(bool, String)>> {
        let mut blobs = HashSet::new();
        for kind in [BlobKind::Artifact, BlobKind::Checkpoint] {
            let digests = match self {
                Self::Bucket(inventory) => inventory.list(kind).await?,
                Self::Folder(inventory) => match inventory.list(kind) {
                    // Without the folder every recorded file is missing, and each is reported.
                    Err(ArtifactError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Vec::new(),
                    listed => listed?,
                },
            };
            blobs.extend(digests.into_iter().map(|digest| (kind == BlobKind::Artifact, digest)));
        }
        Ok(blobs)
    }

    /// Reads a blob, compares it with its digest, and returns its size \[bytes\].
    pub(super) async fn verify(&self, kind: BlobKind, digest: &str) -> Result<u64, ArtifactError> {
        match self {
            Self::Folder(inventory) => inventory.verify(kind, digest),
            Self::Bucket(inventory) => inventory.verify(kind, digest).await,
        }
    }

    /// Describes a problem of a blob. The text follows the name of the blob.
    pub(super) fn problem(&self, error: &ArtifactError) -> String {
        match (self, error) {
            (Self::Bucket(_), ArtifactError::NotFound { .. }) => "is not in the bucket".to_owned(),
            _ => blob_problem(error),
        }
    }

    /// Number of files that are being written, or that a dead server left half written.
    pub(super) fn temporary_files(&self) -> Result<usize, ArtifactError> {
        match self {
            Self::Folder(inventory) => inventory.temporary_files(),
            Self::Bucket(_) => Ok(0),
        }
    }
}

/// Describes a problem of a blob. The text follows the name of the blob.
pub(super) fn blob_problem(error: &ArtifactError) -> String {
    match error {
        ArtifactError::NotFound { .. } => "is not on disk".to_owned(),
        ArtifactError::DataLoss { .. } => "has bytes that do not match its digest".to_owned(),
        other => format!("cannot be read: {}", lightpath_domain::causes::with_causes(other)),
    }
}
