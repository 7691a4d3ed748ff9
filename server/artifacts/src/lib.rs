//! Content-addressed files: targets, phases, photographs, reconstructions, kernels, and the checkpoints of jobs.
//!
//! A blob is named by its digest and written once: a temporary file of the same file system, hashed while it is
//! written, is flushed to disk, renamed to its name, and the folder is flushed too. Only then may the caller record
//! it in the store. So a recorded blob is complete, whenever the power fails, and a half-written one has no name.
//!
//! ```text
//! DATA_DIR/artifacts/ab/sha256-ab…     blobs
//! DATA_DIR/checkpoints/ab/sha256-ab…   resumable state of running jobs; no artifacts, nobody can download them
//! DATA_DIR/uploads/sha256-….part       what has arrived of interrupted uploads
//! DATA_DIR/tmp/                        files being written; emptied at start
//! DATA_DIR/lock                        held by the only process that works here
//! DATA_DIR/keep.lock                   held by backups: no artifact is removed meanwhile
//! ```
//!
//! These are plain files and not the `object_store` crate's local backend, because that one neither flushes to disk
//! unless told nor resumes an upload. File access runs on blocking threads, never on the async runtime's.
//!
//! # Layout
//!
//! - `digest`: names. `folder`: blobs of one folder. `upload`: resumable uploads. `read`: streaming. `error`.
//! - `space`: room on the disk. `inventory`: the files as they lie, for checks and backups beside a server that runs.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod digest;
mod error;
mod folder;
mod inventory;
mod read;
mod space;
#[cfg(test)]
mod tests;
mod upload;

pub use digest::{check_digest, digest_of};
pub use error::ArtifactError;
pub use inventory::{BlobKind, Inventory, digest_of_file};
pub use read::{ArtifactReader, CHUNK_BYTES};
pub use space::SpaceLimits;
pub use upload::{UPLOAD_AGE_MAX, UploadWriter};

use folder::Folder;
use space::Space;
use std::collections::HashSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use tokio::sync::{OwnedRwLockReadGuard, OwnedRwLockWriteGuard, RwLock};

/// A handle to the files of one data folder; cheap to clone.
#[derive(Clone, Debug)]
pub struct Artifacts {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    blobs: Folder,
    checkpoints: Folder,
    uploads: PathBuf,
    data_dir: PathBuf,
    space: Space,
    /// Shared from before a blob gets its name until the store has recorded it; a collection takes it alone, so that it
    /// never removes a file that is about to be recorded again.
    publishing: Arc<RwLock<()>>,
    /// Digests that somebody is uploading right now.
    uploading: Mutex<HashSet<String>>,
    /// Unlocked by the system when the process ends, however it ends.
    _lock: File,
}

impl Artifacts {
    /// Opens, and makes where missing, the folders below `data_dir`; removes what an earlier process left half
    /// written and uploads that nobody went on with for [`UPLOAD_AGE_MAX`].
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Locked`] where another process works in this folder; [`ArtifactError::Io`].
    pub fn open(data_dir: &Path) -> Result<Self, ArtifactError> {
        Self::open_within(data_dir, SpaceLimits::default())
    }

    /// [`Self::open`], with limits on what new work may use.
    ///
    /// # Errors
    ///
    /// As [`Self::open`].
    pub fn open_within(data_dir: &Path, limits: SpaceLimits) -> Result<Self, ArtifactError> {
        let make = |name: &str| -> Result<PathBuf, ArtifactError> {
            let path = data_dir.join(name);
            fs::create_dir_all(&path).map_err(|error| ArtifactError::io("create a folder", error))?;
            Ok(path)
        };
        fs::create_dir_all(data_dir).map_err(|error| ArtifactError::io("create the data folder", error))?;
        let lock = lock(&data_dir.join("lock"))?;
        let temporary = make("tmp")?;
        folder::empty(&temporary).map_err(|error| ArtifactError::io("empty tmp", error))?;
        let uploads = make("uploads")?;
        upload::remove_stale(&uploads).map_err(|error| ArtifactError::io("remove old uploads", error))?;
        Ok(Self {
            inner: Arc::new(Inner {
                blobs: Folder::new(make("artifacts")?, temporary.clone()),
                checkpoints: Folder::new(make("checkpoints")?, temporary),
                uploads,
                data_dir: data_dir.to_owned(),
                space: Space::new(limits),
                publishing: Arc::default(),
                uploading: Mutex::default(),
                _lock: lock,
            }),
        })
    }

    /// To be held from before a blob is stored until the store has recorded it.
    pub async fn publishing(&self) -> OwnedRwLockReadGuard<()> {
        Arc::clone(&self.inner.publishing).read_owned().await
    }

    /// To be held while artifacts are collected; `None` while somebody copies the folder.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Io`].
    pub async fn collecting(&self) -> Result<Option<Collecting>, ArtifactError> {
        let alone = Arc::clone(&self.inner.publishing).write_owned().await;
        let path = self.inner.data_dir.join(inventory::KEEP_LOCK);
        let file = self.blocking(move |_| try_lock(&path)).await?;
        Ok(file.map(|file| Collecting { _alone: alone, _file: file }))
    }

    /// Stores `bytes` and returns their digest. When this returns they are on disk; record them in the store next.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskFull`], [`ArtifactError::Io`].
    pub async fn put_bytes(&self, bytes: Vec<u8>) -> Result<String, ArtifactError> {
        self.blocking(move |inner| inner.blobs.put(&bytes)).await
    }

    /// A whole blob, checked against its digest.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::NotFound`]; [`ArtifactError::DataLoss`] where the file does not match the digest.
    pub async fn read_all(&self, digest: &str) -> Result<Vec<u8>, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.read(&digest)).await
    }

    /// Checks a blob against its digest, then hands out its bytes from `offset_bytes` on, at most `limit_bytes`
    /// of them (0: to the end).
    ///
    /// # Errors
    ///
    /// As [`Self::read_all`]; [`ArtifactError::OutOfRange`] where the offset is past the end.
    pub async fn read(
        &self,
        digest: &str,
        offset_bytes: u64,
        limit_bytes: u64,
    ) -> Result<ArtifactReader, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| {
            let (file, size_bytes) = inner.blobs.open_verified(&digest)?;
            ArtifactReader::new(file, size_bytes, offset_bytes, limit_bytes)
        })
        .await
    }

    /// Size of a blob, where it is on disk \[bytes\]. The bytes are not checked.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn size(&self, digest: &str) -> Result<Option<u64>, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.size(&digest)).await
    }

    /// Removes a blob; that it is gone already is fine.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn delete(&self, digest: &str) -> Result<(), ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.delete(&digest)).await
    }

    /// Stores a checkpoint and returns its digest. Two jobs must never store the same bytes: each deletes its own.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskFull`], [`ArtifactError::Io`].
    pub async fn put_checkpoint(&self, bytes: Vec<u8>) -> Result<String, ArtifactError> {
        self.blocking(move |inner| inner.checkpoints.put(&bytes)).await
    }

    /// A checkpoint, checked against its digest.
    ///
    /// # Errors
    ///
    /// As [`Self::read_all`].
    pub async fn read_checkpoint(&self, digest: &str) -> Result<Vec<u8>, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.checkpoints.read(&digest)).await
    }

    /// Removes a checkpoint; that it is gone already is fine.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn delete_checkpoint(&self, digest: &str) -> Result<(), ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.checkpoints.delete(&digest)).await
    }

    /// Digests of all checkpoints on disk.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Io`].
    pub async fn checkpoints(&self) -> Result<Vec<String>, ArtifactError> {
        self.blocking(|inner| inner.checkpoints.list()).await
    }

    /// Runs file access where it may block. It runs to its end even where the caller goes away.
    async fn blocking<T, F>(&self, work: F) -> Result<T, ArtifactError>
    where
        T: Send + 'static,
        F: FnOnce(&Inner) -> Result<T, ArtifactError> + Send + 'static,
    {
        let inner = Arc::clone(&self.inner);
        blocking(move || work(&inner)).await
    }
}

async fn blocking<T, F>(work: F) -> Result<T, ArtifactError>
where
    T: Send + 'static,
    F: FnOnce() -> Result<T, ArtifactError> + Send + 'static,
{
    match tokio::task::spawn_blocking(work).await {
        Ok(outcome) => outcome,
        Err(error) => match error.try_into_panic() {
            Ok(panic) => std::panic::resume_unwind(panic),
            Err(_) => Err(ArtifactError::io("start", io::Error::other("the server is stopping"))),
        },
    }
}

/// The right to remove artifacts; nobody publishes one and nobody copies them while it lives.
#[derive(Debug)]
pub struct Collecting {
    _alone: OwnedRwLockWriteGuard<()>,
    _file: File,
}

fn lock(path: &Path) -> Result<File, ArtifactError> {
    try_lock(path)?.ok_or_else(|| ArtifactError::Locked { path: path.to_owned() })
}

/// The lock, where nobody holds it.
fn try_lock(path: &Path) -> Result<Option<File>, ArtifactError> {
    let options = File::options().create(true).truncate(false).write(true).open(path);
    let file = options.map_err(|error| ArtifactError::io("open a lock file", error))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(ArtifactError::io("lock the data folder", error)),
    }
}

/// Waits for the lock, and shares it with others who share.
fn lock_shared(path: &Path) -> Result<File, ArtifactError> {
    let options = File::options().create(true).truncate(false).write(true).open(path);
    let file = options.map_err(|error| ArtifactError::io("open a lock file", error))?;
    file.lock_shared().map_err(|error| ArtifactError::io("lock the data folder", error))?;
    Ok(file)
}
