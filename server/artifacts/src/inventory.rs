//! Read access to the files of a data folder, for checks and backups while a server may be running. All functions
//! block.

use crate::digest::{check_digest, name};
use crate::error::{ArtifactError, Result};
use crate::folder::{Folder, empty, flush_folder, hash_rest};
use crate::identity::kept_in;
use crate::lock::lock_shared;
use crate::private::create_private_folder;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Lock file that a backup holds shared while it copies the folder. While it is held, the server removes no artifact.
pub(super) const KEEP_LOCK: &str = "keep.lock";

/// Kind of a blob.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlobKind {
    /// A file that clients can upload or download.
    Artifact,
    /// The saved state of a job.
    Checkpoint,
}

impl BlobKind {
    /// Name of the folder with the blobs of this kind.
    pub(super) fn folder(self) -> &'static str {
        match self {
            Self::Artifact => "artifacts",
            Self::Checkpoint => "checkpoints",
        }
    }
}

/// The blobs of one data folder.
#[derive(Debug)]
pub struct Inventory {
    data_dir: PathBuf,
    artifacts: Folder,
    checkpoints: Folder,
}

impl Inventory {
    /// The blobs below `data_dir`. The folder may be missing.
    #[must_use]
    pub fn of(data_dir: &Path) -> Self {
        let folder = |name| Folder::new(data_dir.join(name), data_dir.join("tmp"));
        Self { data_dir: data_dir.to_owned(), artifacts: folder("artifacts"), checkpoints: folder("checkpoints") }
    }

    /// The identity of the data folder; `None` if it has none, because it was never used with a database on a server.
    pub fn identity(&self) -> Result<Option<String>> {
        kept_in(&self.data_dir)
    }

    /// Creates the folders of a copy below `data_dir`.
    pub fn create(data_dir: &Path) -> Result<Self> {
        for name in ["artifacts", "checkpoints", "tmp"] {
            create_private_folder(&data_dir.join(name)).map_err(|error| ArtifactError::io("create a folder", error))?;
        }
        Ok(Self::of(data_dir))
    }

    /// Locks the folder: while the returned lock lives, the server removes no artifact. `None` if this process cannot
    /// write to the folder and no lock file exists, as on read-only media.
    pub fn prevent_removal(&self) -> Result<Option<File>> {
        lock_shared(&self.data_dir.join(KEEP_LOCK))
    }

    /// Reads a whole blob, compares it with its digest, and returns its size \[bytes\].
    ///
    /// # Errors
    ///
    /// [`ArtifactError::NotFound`]; [`ArtifactError::DataLoss`] if the content does not match the digest.
    pub fn verify(&self, kind: BlobKind, digest: &str) -> Result<u64> {
        Ok(self.folder(kind).open_verified(digest)?.1)
    }

    /// Copies a blob to another folder and returns its size \[bytes\]. The copy is checked and on disk when this
    /// returns.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::verify`]; [`ArtifactError::DiskFull`] if the other disk is full.
    pub fn copy(&self, kind: BlobKind, digest: &str, to: &Self) -> Result<u64> {
        let (mut from, _) = self.folder(kind).open(digest)?;
        to.folder(kind).receive(&mut from, digest)
    }

    /// Opens a blob. Its content is not checked.
    pub(super) fn open(&self, kind: BlobKind, digest: &str) -> Result<File> {
        Ok(self.folder(kind).open(digest)?.0)
    }

    /// Digests of all blobs of a kind.
    pub fn list(&self, kind: BlobKind) -> Result<Vec<String>> {
        self.folder(kind).list()
    }

    /// Counts the temporary files: files that are being written, and files that a dead server left half written.
    pub fn temporary_files(&self) -> Result<usize> {
        match fs::read_dir(self.data_dir.join("tmp")) {
            Ok(files) => Ok(files.count()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
            Err(error) => Err(ArtifactError::io("list files", error)),
        }
    }

    /// Flushes the folders: after this, the copied blobs survive a power failure.
    pub fn flush(&self) -> Result<()> {
        let folders = [self.data_dir.join("artifacts"), self.data_dir.join("checkpoints"), self.data_dir.clone()];
        let flushed = folders.iter().try_for_each(|folder| flush_folder(folder));
        flushed.map_err(|error| ArtifactError::io("flush a folder", error))
    }

    /// Removes all blobs and temporary files.
    pub fn clear(&self) -> Result<()> {
        for name in ["artifacts", "checkpoints", "tmp"] {
            empty(&self.data_dir.join(name)).map_err(|error| ArtifactError::io("empty a folder", error))?;
        }
        Ok(())
    }

    fn folder(&self, kind: BlobKind) -> &Folder {
        match kind {
            BlobKind::Artifact => &self.artifacts,
            BlobKind::Checkpoint => &self.checkpoints,
        }
    }
}

/// Hashes a file of any name. Backups compare the digest with that of the database they wrote.
pub fn digest_of_file(path: &Path) -> Result<String> {
    let hash = || -> io::Result<String> { Ok(name(hash_rest(&mut File::open(path)?)?)) };
    let digest = hash().map_err(|error| ArtifactError::io("read a file", error))?;
    check_digest(&digest)?;
    Ok(digest)
}
