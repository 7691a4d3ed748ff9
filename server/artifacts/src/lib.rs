//! Content-addressed files: targets, phases, photographs, reconstructions, kernels, and the checkpoints of jobs.
//!
//! The name of a blob is its digest, and a blob is written only once. A temporary file on the same file system is
//! hashed while it is written, flushed to disk, and renamed to the digest; then the folder is flushed. Only after that
//! may the caller record the blob in the store. So every recorded blob is complete even after a power failure, and a
//! half-written file never has the name of a blob.
//!
//! ```text
//! DATA_DIR/artifacts/ab/sha256-ab…     blobs
//! DATA_DIR/checkpoints/ab/sha256-ab…   resumable states of running jobs; clients cannot download them
//! DATA_DIR/uploads/sha256-….part       stored parts of interrupted uploads, by artifact and owner
//! DATA_DIR/conversions/ab/sha256-ab…  files that can be made again, such as converted kernels; emptied at start
//! DATA_DIR/tmp/                        files being written; emptied at start
//! DATA_DIR/lock                        held by the one process that uses the folder
//! DATA_DIR/keep.lock                   held by a backup; while it is held, the server removes no artifact
//! ```
//!
//! The crate writes plain files and does not use the local backend of the `object_store` crate: that backend does not
//! flush to disk by default and cannot resume an upload. File access runs on blocking threads, never on the threads of
//! the async runtime.
//!
//! # Layout
//!
//! - `digest`: names of blobs. `folder`: blobs of one folder. `upload`: resumable uploads. `read`: streaming. `error`.
//! - `space`: free space on the disk. `lock`: locks on files. `blocking`: threads for file access. `inventory`: read access for checks and backups while a server may be running.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod blocking;
mod digest;
mod error;
mod folder;
mod inventory;
mod lock;
mod read;
mod space;
#[cfg(test)]
mod tests;
mod upload;

pub use digest::{check_digest, digest_of};
pub use error::ArtifactError;
pub use inventory::{BlobKind, Inventory, digest_of_file};
pub use read::{ArtifactReader, CHUNK_BYTES};
pub use space::{Space, SpaceLimits};
pub use upload::{UPLOAD_AGE_MAX, UploadWriter, Uploads};

use blocking::blocking;
use folder::Folder;
use lock::{lock, try_lock};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::sync::{OwnedRwLockReadGuard, OwnedRwLockWriteGuard, RwLock};

/// A handle to the files of one data folder; cheap to clone.
#[derive(Clone, Debug)]
pub struct Artifacts {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    blobs: Arc<Folder>,
    checkpoints: Folder,
    conversions: Folder,
    uploads: Uploads,
    data_dir: PathBuf,
    space: Space,
    /// A writer holds this lock shared from before a blob gets its name until the store has recorded the blob. A
    /// collection of artifacts holds it exclusively, so that it never removes a file that is about to be recorded again.
    publishing: Arc<RwLock<()>>,
    /// Lock of the data folder. The operating system releases it when the process ends, even after a crash.
    _lock: File,
}

impl Artifacts {
    /// Opens the folders below `data_dir` and creates those that are missing. Removes files that an earlier process
    /// left half written, and uploads that have not grown for [`UPLOAD_AGE_MAX`].
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Locked`] if another process uses this folder; [`ArtifactError::Io`].
    pub fn open(data_dir: &Path) -> Result<Self, ArtifactError> {
        Self::open_within(data_dir, SpaceLimits::default())
    }

    /// Does the same as [`Self::open`], with limits on the space that new work may use.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::open`].
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
        let conversions = make("conversions")?;
        folder::empty(&conversions).map_err(|error| ArtifactError::io("empty conversions", error))?;
        let blobs = Arc::new(Folder::new(make("artifacts")?, temporary.clone()));
        let uploads = Uploads::open(make("uploads")?, Arc::clone(&blobs))?;
        Ok(Self {
            inner: Arc::new(Inner {
                blobs,
                checkpoints: Folder::new(make("checkpoints")?, temporary.clone()),
                conversions: Folder::new(conversions, temporary),
                uploads,
                data_dir: data_dir.to_owned(),
                space: Space::new(limits, data_dir.to_owned()),
                publishing: Arc::default(),
                _lock: lock,
            }),
        })
    }

    /// The disk of the folder, and the limits on its use.
    #[must_use]
    pub fn space(&self) -> &Space {
        &self.inner.space
    }

    /// The uploads.
    #[must_use]
    pub fn uploads(&self) -> &Uploads {
        &self.inner.uploads
    }

    /// Returns a lock that prevents a collection of artifacts. The caller takes it before it stores a blob and drops it
    /// after the store has recorded the blob.
    pub async fn publishing(&self) -> OwnedRwLockReadGuard<()> {
        Arc::clone(&self.inner.publishing).read_owned().await
    }

    /// Returns a lock to hold while unused artifacts are removed; `None` while a backup copies the folder.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Io`].
    pub async fn collecting(&self) -> Result<Option<Collecting>, ArtifactError> {
        let no_publishing = Arc::clone(&self.inner.publishing).write_owned().await;
        let path = self.inner.data_dir.join(inventory::KEEP_LOCK);
        let file = self.blocking(move |_| try_lock(&path)).await?;
        Ok(file.map(|file| Collecting { _no_publishing: no_publishing, _no_backup: file }))
    }

    /// Stores `bytes` and returns their digest. When this returns they are on disk; record them in the store next.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskFull`], [`ArtifactError::Io`].
    pub async fn put_bytes(&self, bytes: Vec<u8>) -> Result<String, ArtifactError> {
        self.blocking(move |inner| inner.blobs.put(&bytes)).await
    }

    /// Reads a whole blob and checks it against its digest.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::NotFound`]; [`ArtifactError::DataLoss`] if the file does not match the digest.
    pub async fn read_all(&self, digest: &str) -> Result<Vec<u8>, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.read(&digest)).await
    }

    /// Does the same as [`Self::read_all`] on the calling thread, which may block.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_all`].
    pub fn read_blocking(&self, digest: &str) -> Result<Vec<u8>, ArtifactError> {
        self.inner.blobs.read(digest)
    }

    /// Opens a blob for a look at its header, on the calling thread, which may block. The content is not checked.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::NotFound`], [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub fn open_blocking(&self, digest: &str) -> Result<File, ArtifactError> {
        Ok(self.inner.blobs.open(digest)?.0)
    }

    /// Checks a blob against its digest, then returns a reader of its bytes from `offset_bytes` on, on the calling thread,
    /// which may block. The reader returns at most `limit_bytes` (0: to the end).
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_all`]; [`ArtifactError::OutOfRange`] if the offset is past the end.
    pub fn read_range_blocking(
        &self,
        digest: &str,
        offset_bytes: u64,
        limit_bytes: u64,
    ) -> Result<ArtifactReader, ArtifactError> {
        let (file, size_bytes) = self.inner.blobs.open_verified(digest)?;
        ArtifactReader::new(file, size_bytes, offset_bytes, limit_bytes)
    }

    /// Size of a blob \[bytes\]; `None` if it is not on disk. The content is not checked.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn size(&self, digest: &str) -> Result<Option<u64>, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.size(&digest)).await
    }

    /// Removes a blob. A missing blob is no error.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn delete(&self, digest: &str) -> Result<(), ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.delete(&digest)).await
    }

    /// Stores a checkpoint and returns its digest. Two jobs must never store the same bytes, because each job deletes its
    /// own checkpoints.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskFull`], [`ArtifactError::Io`].
    pub async fn put_checkpoint(&self, bytes: Vec<u8>) -> Result<String, ArtifactError> {
        self.blocking(move |inner| inner.checkpoints.put(&bytes)).await
    }

    /// Reads a checkpoint and checks it against its digest.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_all`].
    pub async fn read_checkpoint(&self, digest: &str) -> Result<Vec<u8>, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.checkpoints.read(&digest)).await
    }

    /// Removes a checkpoint. A missing checkpoint is no error.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn delete_checkpoint(&self, digest: &str) -> Result<(), ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.checkpoints.delete(&digest)).await
    }

    /// Stores a file that can be made again, and returns its digest.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`] if the file would use the reserve of the disk; [`ArtifactError::DiskFull`],
    /// [`ArtifactError::Io`].
    pub async fn put_conversion(&self, bytes: Vec<u8>) -> Result<String, ArtifactError> {
        self.blocking(move |inner| {
            inner.space.admit_temporary(bytes.len() as u64)?;
            inner.conversions.put(&bytes)
        })
        .await
    }

    /// Checks a stored conversion against its digest, then returns a reader of its bytes.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_all`].
    pub async fn read_conversion(&self, digest: &str) -> Result<ArtifactReader, ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| {
            let (file, size_bytes) = inner.conversions.open_verified(&digest)?;
            ArtifactReader::new(file, size_bytes, 0, 0)
        })
        .await
    }

    /// Removes a conversion. A missing one is no error.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::BadDigest`], [`ArtifactError::Io`].
    pub async fn delete_conversion(&self, digest: &str) -> Result<(), ArtifactError> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.conversions.delete(&digest)).await
    }

    /// Digests of all checkpoints on disk.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Io`].
    pub async fn checkpoints(&self) -> Result<Vec<String>, ArtifactError> {
        self.blocking(|inner| inner.checkpoints.list()).await
    }

    async fn blocking<T, F>(&self, work: F) -> Result<T, ArtifactError>
    where
        T: Send + 'static,
        F: FnOnce(&Inner) -> Result<T, ArtifactError> + Send + 'static,
    {
        let inner = Arc::clone(&self.inner);
        blocking(move || work(&inner)).await
    }
}

/// Permission to remove artifacts: while it lives, no artifact is published and no backup copies the folder.
#[derive(Debug)]
pub struct Collecting {
    _no_publishing: OwnedRwLockWriteGuard<()>,
    _no_backup: File,
}
