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
//! DATA_DIR/uploads/unnamed-….part      running uploads whose digest nobody knows yet
//! DATA_DIR/conversions/ab/sha256-ab…  files that can be made again, such as converted kernels
//! DATA_DIR/conversions/notes          what these files are, by the program that made them
//! DATA_DIR/tmp/                        files being written; emptied at start
//! DATA_DIR/identity                   name of this folder for a database on another machine
//! DATA_DIR/restore.unfinished          a restore into this folder has begun and has not ended
//! DATA_DIR/lock                        held by the one process that uses the folder: a server, a restore, a collection
//! DATA_DIR/keep.lock                   held by a backup, and by the process of a job while it stores a result; while it
//!                                      is held, the server removes no artifact
//! ```
//!
//! The crate writes plain files and does not use the local backend of the `object_store` crate: that backend does not
//! flush to disk by default and cannot resume an upload. File access runs on blocking threads, never on the threads of
//! the async runtime.
//!
//! # Errors
//!
//! Every function that uses files can fail with [`ArtifactError::Io`], one that writes files also with
//! [`ArtifactError::DiskFull`], one that takes a digest with [`ArtifactError::BadDigest`], and one that uses the remote
//! with [`ArtifactError::Remote`]. Functions name only their other errors.
//!
//! # Layout
//!
//! - `digest`: names of blobs. `folder`: blobs of one folder. `blobs`: such a folder, and the remote behind it. `remote`: blobs in a bucket. `publish`: storing and recording. `remote_calls`: what else processes that share a bucket do. `upload`: resumable uploads. `interrupted`: uploads that wait for a call that continues them. `conversions`: files that can be made again; `conversion_calls`: storing and reading them. `read`: streaming. `error`.
//! - `examined`: files that were hashed recently. `identity`: the name of a data folder. `space`: free space on the disk. `claim`: room that is claimed before bytes are written. `lock`: locks on files. `private`: modes of files. `blocking`: threads for file access. `inventory`: read access for checks and backups while a server may be running.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::print_stdout))]

mod blobs;
mod blocking;
mod claim;
mod conversion_calls;
mod conversions;
mod digest;
mod error;
mod examined;
mod folder;
mod identity;
mod interrupted;
mod inventory;
mod lock;
mod private;
mod publish;
mod read;
mod remote;
mod remote_calls;
#[cfg(test)]
mod room_tests;
mod space;
#[cfg(test)]
mod tests;
mod upload;

pub use claim::Claim;
pub use digest::{check_digest, digest_of};
pub use error::{ArtifactError, Result};
pub use interrupted::UPLOAD_AGE_MAX;
pub use inventory::{BlobKind, Inventory, digest_of_file};
pub use lock::{FolderLock, LOCK, RESTORING};
pub use private::{create_private_folder, make_private, private_file};
pub use publish::Content;
pub use read::{ArtifactReader, CHUNK_BYTES};
pub use remote::RemoteObject;
pub use remote::inventory::BucketInventory;
pub use remote::options::RemoteOptions;
pub use space::{Space, SpaceLimits};
pub use upload::{UploadTurn, UploadWriter, Uploads};

use blobs::Blobs;
use blocking::blocking;
use conversions::Conversions;
use examined::Examined;
use folder::Folder;
use interrupted::Interrupted;
use lock::try_lock;
use remote::Remote;
use remote::cache::Cache;
use std::fs::File;
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
    blobs: Arc<Blobs>,
    examined: Examined,
    checkpoints: Blobs,
    conversions: Arc<Conversions>,
    uploads: Uploads,
    remote: Option<Arc<Remote>>,
    data_dir: PathBuf,
    space: Arc<Space>,
    /// A writer holds this lock shared from before a blob gets its name until the store has recorded the blob. A
    /// collection of artifacts holds it exclusively, so that it never removes a file that is about to be recorded
    /// again.
    publishing: Arc<RwLock<()>>,
    /// The operating system releases it when the process ends, even after a crash.
    held: Held,
}

/// What a process holds while it uses a data folder.
#[derive(Debug)]
enum Held {
    /// The folder: no other process uses it.
    Folder { _lock: FolderLock },
    /// Nothing: the process holds the folder that started this one.
    Beside,
}

/// While it lives, no process removes artifacts.
#[derive(Debug)]
struct Publishing {
    _no_collection: OwnedRwLockReadGuard<()>,
    /// The removal by the process that holds the folder, if that is another one.
    _no_removal: Option<File>,
}

impl Artifacts {
    /// Opens the folders below `data_dir` and creates those that are missing. Removes files that an earlier process
    /// left half written, and interrupted uploads that have not grown for [`UPLOAD_AGE_MAX`].
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Locked`] if another process uses this folder; [`ArtifactError::Unfinished`] if a restore into it
    /// died.
    pub fn open(data_dir: &Path) -> Result<Self> {
        Self::open_within(data_dir, SpaceLimits::default())
    }

    /// Does the same as [`Self::open`], with limits on the space that new work may use.
    pub fn open_within(data_dir: &Path, limits: SpaceLimits) -> Result<Self> {
        Self::open_with(data_dir, limits, None)
    }

    /// Does the same as [`Self::open_within`]. With a remote, artifacts and checkpoints are kept there, and the folders
    /// are a cache: a blob is stored in the remote before a call that stores it returns, and is fetched when it is
    /// read and not in the cache. Files from a time without the remote are stored there first, which can take long;
    /// otherwise this blocks until the remote has answered, or for half a minute.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::open`]; [`ArtifactError::BadRemote`], [`ArtifactError::UnfitRemote`],
    /// [`ArtifactError::OtherRemote`].
    pub fn open_with(data_dir: &Path, limits: SpaceLimits, remote: Option<&RemoteOptions>) -> Result<Self> {
        let open = |options: &RemoteOptions| Ok((Remote::open(options, data_dir)?, options.cache_bytes_max));
        let held = Held::Folder { _lock: FolderLock::take(data_dir)? };
        Self::open_on(data_dir, limits, held, || remote.map(open).transpose())
    }

    /// Opens a data folder that the process holds which started this one, to read and store blobs for it. That process
    /// removes no artifact while this one publishes some.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::open_with`], without [`ArtifactError::Locked`].
    pub fn open_beside(data_dir: &Path, limits: SpaceLimits, remote: Option<&RemoteOptions>) -> Result<Self> {
        let open = |options: &RemoteOptions| Ok((Remote::open(options, data_dir)?, options.cache_bytes_max));
        Self::open_on(data_dir, limits, Held::Beside, || remote.map(open).transpose())
    }

    /// Does the same as [`Self::open_with`], with a function that connects to the remote and returns it and the bound of
    /// the cache \[bytes\]. It is called when the data folder is locked, as `held` says.
    fn open_on(
        data_dir: &Path,
        limits: SpaceLimits,
        held: Held,
        connect: impl FnOnce() -> Result<Option<(Remote, u64)>>,
    ) -> Result<Self> {
        let make = |name: &str| -> Result<PathBuf> {
            let path = data_dir.join(name);
            create_private_folder(&path).map_err(|error| ArtifactError::io("create a folder", error))?;
            Ok(path)
        };
        let (temporary, conversions) = (make("tmp")?, make("conversions")?);
        let received = match held {
            Held::Folder { .. } => {
                folder::empty(&temporary).map_err(|error| ArtifactError::io("empty tmp", error))?;
                make("uploads")?
            }
            // The uploads are those of the other process.
            Held::Beside => make("tmp/uploads")?,
        };
        let (artifacts, checkpoints) = (make("artifacts")?, make("checkpoints")?);
        let behind = match connect()? {
            Some((remote, cache_bytes_max)) => {
                let cache = Cache::open(cache_bytes_max, &[&artifacts, &checkpoints]);
                let cache = cache.map_err(|error| ArtifactError::io("open the cache", error))?;
                Some((Arc::new(remote), Arc::new(cache)))
            }
            None => {
                remote::catch_up::note_use_without(data_dir)?;
                None
            }
        };
        let (remote, cache) = behind.clone().unzip();
        let conversions = Arc::new(Conversions::new(Folder::new(conversions, temporary.clone())));
        let interrupted = Interrupted::open(received.clone())?;
        let space = Arc::new(Space::new(limits, data_dir.to_owned(), interrupted, Arc::clone(&conversions), cache));
        let blobs = |kind, root| Blobs::new(kind, Folder::new(root, temporary.clone()), &space, behind.clone());
        let checkpoints = blobs(BlobKind::Checkpoint, checkpoints);
        let blobs = Arc::new(blobs(BlobKind::Artifact, artifacts));
        let uploads = Uploads::new(received, Arc::clone(&space), Arc::clone(&blobs));
        Ok(Self {
            inner: Arc::new(Inner {
                blobs,
                examined: Examined::default(),
                checkpoints,
                conversions,
                uploads,
                remote,
                data_dir: data_dir.to_owned(),
                space,
                publishing: Arc::default(),
                held,
            }),
        })
    }

    /// The identity of the place where the blobs are, a UUID, for a database on another machine: that of the installation
    /// whose objects are in the remote, or that of the data folder.
    pub async fn identity(&self) -> Result<String> {
        self.blocking(|inner| match &inner.remote {
            Some(remote) => Ok(remote.installation().to_owned()),
            None => identity::identity_of(&inner.data_dir),
        })
        .await
    }

    /// The identity of the data folder, a UUID. Only this process holds the folder, so no other one has this identity.
    pub async fn folder_identity(&self) -> Result<String> {
        self.blocking(|inner| identity::identity_of(&inner.data_dir)).await
    }

    /// The identity that the data folder had before its blobs moved to the bucket; `None` if it had none, or there is no
    /// bucket.
    pub async fn former_identity(&self) -> Result<Option<String>> {
        self.blocking(|inner| match inner.remote {
            Some(_) => identity::kept_in(&inner.data_dir),
            None => Ok(None),
        })
        .await
    }

    /// The disk of the folder, and the limits on its use.
    #[must_use]
    pub fn space(&self) -> &Arc<Space> {
        &self.inner.space
    }

    /// The digest of bytes that are about to be stored, and the bytes. They are hashed on a thread that may block.
    pub async fn digest_of(&self, bytes: Vec<u8>) -> Result<(String, Vec<u8>)> {
        self.blocking(move |_| Ok((digest_of(&bytes), bytes))).await
    }

    /// Claims room for an artifact of `size_bytes` that is about to be stored for an owner.
    ///
    /// # Errors
    ///
    /// The errors of [`Claim::take`].
    pub async fn claim(&self, owner: &str, size_bytes: u64) -> Result<Claim> {
        let owner = owner.to_owned();
        self.blocking(move |inner| Claim::take(&inner.space, &owner, size_bytes, size_bytes)).await
    }

    /// The uploads.
    #[must_use]
    pub fn uploads(&self) -> &Uploads {
        &self.inner.uploads
    }

    /// Whether other processes may store and remove blobs, because they are in a bucket.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        self.inner.remote.is_some()
    }

    /// Returns a lock that prevents a collection of artifacts by this process. It is taken before a blob is stored, and
    /// dropped after the store has recorded the blob.
    async fn publishing(&self) -> Result<Publishing> {
        let no_collection = Arc::clone(&self.inner.publishing).read_owned().await;
        let no_removal = match self.inner.held {
            Held::Folder { .. } => None,
            Held::Beside => {
                let path = self.inner.data_dir.join(inventory::KEEP_LOCK);
                self.blocking(move |_| lock::lock_shared(&path)).await?
            }
        };
        Ok(Publishing { _no_collection: no_collection, _no_removal: no_removal })
    }

    /// Returns a lock to hold while unused artifacts are removed; `None` while a backup copies the folder, or the process of
    /// a job stores a result.
    pub async fn collecting(&self) -> Result<Option<Collecting>> {
        let no_publishing = Arc::clone(&self.inner.publishing).write_owned().await;
        let path = self.inner.data_dir.join(inventory::KEEP_LOCK);
        let file = self.blocking(move |_| try_lock(&path)).await?;
        Ok(file.map(|file| Collecting { _no_publishing: no_publishing, _no_backup: file }))
    }

    /// Stores `bytes` and returns their digest. When this returns they are on disk, and nothing records them: see
    /// [`Self::publish`].
    pub async fn put_bytes(&self, bytes: Vec<u8>) -> Result<String> {
        self.blocking(move |inner| inner.blobs.put(&bytes)).await
    }

    /// Reads a whole blob and checks it against its digest.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::NotFound`]; [`ArtifactError::DataLoss`] if the file does not match the digest.
    pub async fn read_all(&self, digest: &str) -> Result<Vec<u8>> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.noticing_damage(&digest, inner.blobs.read(&digest))).await
    }

    /// Does the same as [`Self::read_all`] on the calling thread, which may block.
    pub fn read_blocking(&self, digest: &str) -> Result<Vec<u8>> {
        self.inner.noticing_damage(digest, self.inner.blobs.read(digest))
    }

    /// Opens a blob for a look at its header, on the calling thread, which may block. The content is not checked.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::NotFound`].
    pub fn open_blocking(&self, digest: &str) -> Result<File> {
        Ok(self.inner.blobs.open(digest)?.0)
    }

    /// Checks a blob against its digest, then returns a reader of its bytes from `offset_bytes` on, on the calling
    /// thread, which may block. The reader returns at most `limit_bytes` (0: to the end).
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_all`]; [`ArtifactError::OutOfRange`] if the offset is past the end.
    pub fn read_range_blocking(&self, digest: &str, offset_bytes: u64, limit_bytes: u64) -> Result<ArtifactReader> {
        let (file, size_bytes) = self.inner.noticing_damage(digest, self.inner.blobs.open_verified(digest))?;
        ArtifactReader::new(file, size_bytes, offset_bytes, limit_bytes)
    }

    /// Whether the file of a blob exists, also in the remote, and has the content of its digest, for a client that offers this content. To
    /// limit the cost, one file at a time is hashed, and a file that has not changed is hashed again only after some
    /// minutes. If others make a call wait for too long, the call believes that the file is intact.
    pub async fn is_intact(&self, digest: &str) -> Result<bool> {
        let digest = digest.to_owned();
        let (digest, known) = self
            .blocking(move |inner| {
                let known = inner.finding(&digest)?;
                Ok((digest, known))
            })
            .await?;
        if let (Some(is_intact), true) = (known, self.inner.blobs.is_only_local()) {
            return Ok(is_intact);
        }
        if known == Some(true) {
            return self.blocking(move |inner| inner.blobs.is_stored(&digest)).await;
        }
        let Some(turn) = self.inner.examined.turn().await else {
            return self.blocking(move |inner| inner.blobs.is_stored(&digest)).await;
        };
        self.blocking(move |inner| {
            // The turn belongs to the thread that hashes, so that clients that hang up do not start more threads.
            let _turn = turn;
            Ok(inner.examine(&digest)? && inner.blobs.is_stored(&digest)?)
        })
        .await
    }

    /// Size of a blob \[bytes\]; `None` if it is neither on disk nor in the remote. The content is not checked.
    pub async fn size(&self, digest: &str) -> Result<Option<u64>> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.size(&digest)).await
    }

    /// Removes a blob, also from the remote. A missing blob is no error. Processes that share a remote remove blobs with
    /// [`Self::objects_of`] and [`Self::delete_objects`] instead.
    pub async fn delete(&self, digest: &str) -> Result<()> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.blobs.delete(&digest)).await
    }

    /// Stores a checkpoint and returns its digest. Two jobs must never store the same bytes, because each job deletes
    /// its own checkpoints.
    pub async fn put_checkpoint(&self, bytes: Vec<u8>) -> Result<String> {
        self.blocking(move |inner| inner.checkpoints.put(&bytes)).await
    }

    /// Reads a checkpoint and checks it against its digest.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_all`].
    pub async fn read_checkpoint(&self, digest: &str) -> Result<Vec<u8>> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.checkpoints.read(&digest)).await
    }

    /// Removes a checkpoint. A missing checkpoint is no error.
    pub async fn delete_checkpoint(&self, digest: &str) -> Result<()> {
        let digest = digest.to_owned();
        self.blocking(move |inner| inner.checkpoints.delete(&digest)).await
    }

    /// Digests of all checkpoints on disk. With a remote, these are the cached ones.
    pub async fn checkpoints(&self) -> Result<Vec<String>> {
        self.blocking(|inner| inner.checkpoints.list()).await
    }

    async fn blocking<T, F>(&self, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: FnOnce(&Inner) -> Result<T> + Send + 'static,
    {
        let inner = Arc::clone(&self.inner);
        blocking(move || work(&inner)).await
    }
}

impl Inner {
    /// Whether a blob is intact, as far as that is known without hashing its file.
    fn finding(&self, digest: &str) -> Result<Option<bool>> {
        match self.blobs.stamp(digest)? {
            None if self.blobs.is_only_local() => Ok(Some(false)),
            None => Ok(None),
            Some(stamp) => Ok(self.examined.finding(digest, stamp)),
        }
    }

    /// Whether a blob is intact. Hashes its file, unless another call has done so in the meantime.
    fn examine(&self, digest: &str) -> Result<bool> {
        if let Some(known) = self.finding(digest)? {
            return Ok(known);
        }
        let before = self.blobs.stamp(digest)?;
        let is_intact = match self.blobs.open_verified(digest) {
            Ok(_) => true,
            Err(ArtifactError::DataLoss { .. } | ArtifactError::NotFound { .. }) => false,
            Err(error) => return Err(error),
        };
        // A blob that was fetched has its file only now.
        if let Some(stamp) = before.map_or_else(|| self.blobs.stamp(digest), |stamp| Ok(Some(stamp)))? {
            self.examined.record(digest, stamp, is_intact);
        }
        Ok(is_intact)
    }

    /// Passes on the outcome of reading a blob. If the blob is damaged, forgets earlier findings about its file.
    fn noticing_damage<T>(&self, digest: &str, outcome: Result<T>) -> Result<T> {
        if matches!(outcome, Err(ArtifactError::DataLoss { .. })) {
            self.examined.forget(digest);
        }
        outcome
    }
}

/// Permission to remove artifacts: while it lives, no artifact is published and no backup copies the folder.
#[derive(Debug)]
pub struct Collecting {
    _no_publishing: OwnedRwLockWriteGuard<()>,
    _no_backup: File,
}
