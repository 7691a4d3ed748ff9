//! Moves the database of a server from its data folder to PostgreSQL, or back, and its files to a bucket.
//!
//! The data folder is locked for the whole time, and so is the database on the server. The copy is exact: running jobs
//! keep their leases and saved states, and go back into the queue when a server starts. Generations of displays and the
//! keyring stay as they are. A restore raises them, because devices may have seen newer ones than those of the backup;
//! a move takes the newest state along, so nothing that a device has seen is lost.

use super::blob_reader::blob_problem;
use super::{Finding, FindingKind, Result, open_artifacts};
use crate::config::Config;
use crate::database::{DATABASE, DatabaseError};
use lightpath_artifacts::{ArtifactError, Artifacts, BlobKind, Inventory};
use lightpath_store::{ComparedTable, Inspection, Side, Transfer};
use serde::Serialize;
use std::path::Path;

/// A move of a server's database.
#[derive(Clone, Debug)]
pub struct Migration {
    /// Settings of the server after the move, and before it if it moves to its folder: the data folder, the database on a
    /// server, and the bucket of the artifacts.
    pub config: Config,
    /// URL of the database of PostgreSQL.
    pub url: String,
    /// Whether the database moves from the data folder to PostgreSQL, or back.
    pub to_server: bool,
}

/// Result of a move.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Moved {
    /// Number of rows.
    pub rows: u64,
    /// The tables, which were compared.
    pub tables: Vec<MovedTable>,
    /// The files in the bucket; `None`: the files stay in the data folder.
    pub blobs: Option<MovedBlobs>,
}

/// A table that was read on both sides after the copy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MovedTable {
    /// Name of the table.
    pub name: &'static str,
    /// Number of its rows.
    pub rows: u64,
    /// SHA-256 of its rows.
    pub digest: String,
}

/// Files that were read back from the bucket.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MovedBlobs {
    /// Number of artifacts and saved states in the bucket that match their digests.
    pub files: u64,
    /// Their size \[bytes\].
    pub bytes: u64,
    /// Files that are not in the bucket, because they are missing or damaged in the data folder, too.
    pub damaged: Vec<Finding>,
}

/// What is being done: a step, and how much of it.
pub(super) type Progress<'p> = dyn FnMut(&'static str, u64, u64) + Send + 'p;

impl Migration {
    /// Moves everything. After an interruption, the same call continues. The source does not change.
    ///
    /// # Errors
    ///
    /// [`DatabaseError::NoData`] if the data folder has no database to move; [`ArtifactError::Locked`] while a server uses
    /// the folder; [`DatabaseError::OtherArtifacts`] if the database on the server names files that are not in the data
    /// folder; [`super::UpkeepError::Transfer`].
    pub async fn run(&self, progress: &mut Progress<'_>) -> Result<Moved> {
        let file = self.config.data_dir.join(DATABASE);
        if self.to_server && !file.is_file() {
            return Err(DatabaseError::NoData { path: self.config.data_dir.clone() }.into());
        }
        progress("opening", 0, 0);
        let artifacts = self.open_artifacts().await?;
        let identity = artifacts.identity().await?;
        let (folder, server) = (Side::File(file), Side::Server(self.url.clone()));
        let (from, to) = if self.to_server { (folder, server) } else { (server, folder) };
        if !self.to_server {
            self.require_artifacts(&identity).await?;
        }
        let mut transfer = Transfer::begin(&from, &to, &identity).await?;
        transfer.copy(|done, all| progress("copying rows", done, all)).await?;
        let tables = transfer.verify(|done, all| progress("comparing rows", done, all)).await?;
        let blobs = match self.config.bucket()? {
            Some(_) => Some(verify_blobs(&mut transfer, &artifacts, &self.config.data_dir, progress).await?),
            None => None,
        };
        transfer.finish(self.to_server.then_some(&*identity)).await?;
        let rows = tables.iter().map(|table| table.rows).sum();
        let moved = |ComparedTable { name, rows, digest }| MovedTable { name, rows, digest };
        Ok(Moved { rows, tables: tables.into_iter().map(moved).collect(), blobs })
    }

    /// Refuses a database on the server that names other artifacts than these, before the target has anything.
    async fn require_artifacts(&self, identity: &str) -> Result<()> {
        let mut inspection = Inspection::connect(&self.url).await?;
        let recorded = inspection.artifact_place().await?;
        inspection.close().await?;
        match recorded.filter(|recorded| recorded != identity) {
            Some(recorded) => Err(DatabaseError::OtherArtifacts { recorded, found: identity.to_owned() }.into()),
            None => Ok(()),
        }
    }

    /// Locks the data folder. With a bucket, this stores the files of the folder there, which can take long.
    async fn open_artifacts(&self) -> Result<Artifacts> {
        let config = self.config.clone();
        match tokio::task::spawn_blocking(move || open_artifacts(&config)).await {
            Ok(opened) => opened,
            Err(error) => std::panic::resume_unwind(error.into_panic()),
        }
    }
}

/// Reads each file of the bucket and compares it with its digest.
async fn verify_blobs(
    transfer: &mut Transfer,
    artifacts: &Artifacts,
    data_dir: &Path,
    progress: &mut Progress<'_>,
) -> Result<MovedBlobs> {
    let (digests, checkpoints) = transfer.blobs().await?;
    let all = digests.len() + checkpoints.len();
    let named = |kind| move |digest| (kind, digest);
    let blobs = digests.into_iter().map(named(BlobKind::Artifact));
    let blobs = blobs.chain(checkpoints.into_iter().map(named(BlobKind::Checkpoint)));
    let (inventory, mut moved) = (Inventory::of(data_dir), MovedBlobs::default());
    for (n, (kind, digest)) in blobs.enumerate() {
        progress("reading the bucket", n as u64, all as u64);
        match artifacts.verify(kind, &digest).await {
            Ok(size_bytes) => {
                moved.files += 1;
                moved.bytes += size_bytes.unwrap_or_default();
            }
            Err(error @ (ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. })) => {
                if let Ok(size_bytes) = inventory.verify(kind, &digest) {
                    artifacts.store_anew(kind, &digest).await?;
                    artifacts.verify(kind, &digest).await?;
                    moved.files += 1;
                    moved.bytes += size_bytes;
                    continue;
                }
                let kind = if kind == BlobKind::Artifact { FindingKind::Artifact } else { FindingKind::Checkpoint };
                moved.damaged.push(Finding { kind, what: digest, problem: blob_problem(&error) });
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(moved)
}
