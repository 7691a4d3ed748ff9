//! Resumable uploads: the received part of an interrupted upload is kept, and a later call continues it. An upload whose
//! digest nobody knows yet cannot be found again, so that nothing of it is kept.

use crate::blobs::Blobs;
use crate::blocking::blocking;
use crate::digest::{check_digest, digest_of, name};
use crate::error::{ArtifactError, Result};
use crate::folder::hash_rest;
use crate::private::private_file;
use lightpath_fail_points as fail;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time after which an interrupted upload that has not grown is removed at the next start.
pub const UPLOAD_AGE_MAX: Duration = Duration::from_secs(7 * 24 * 3600);

/// An upload in progress. If it is dropped before [`UploadWriter::finish`], the received bytes are kept for a later
/// call, if the upload has a digest.
#[derive(Debug)]
pub struct UploadWriter {
    /// `None` while a blocking thread works on the file.
    part: Option<Part>,
    received_bytes: u64,
}

#[derive(Debug)]
struct Part {
    file: File,
    path: PathBuf,
    hasher: Sha256,
    received_bytes: u64,
    size_bytes: u64,
    lock: UploadLock,
}

/// The interrupted and running uploads of one data folder; cheap to clone.
#[derive(Clone, Debug)]
pub struct Uploads {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    folder: PathBuf,
    /// Where the blob of a complete upload goes.
    blobs: Arc<Blobs>,
    /// Names of the files of running uploads.
    running: Mutex<HashSet<String>>,
    /// Number of uploads without a digest so far.
    unnamed: AtomicU64,
}

/// Lock on an owner's upload of the artifact with this digest: at most one call at a time continues it. Released on
/// drop.
#[derive(Debug)]
struct UploadLock {
    uploads: Uploads,
    /// `None`: nobody knows the digest yet, so the file is removed with the lock.
    digest: Option<String>,
    file_name: String,
}

impl Uploads {
    /// Uploads whose received parts are in `folder`, and whose blobs go to `blobs`. Removes uploads that have not grown
    /// for [`UPLOAD_AGE_MAX`].
    pub(crate) fn open(folder: PathBuf, blobs: Arc<Blobs>) -> Result<Self> {
        remove_stale(&folder).map_err(|error| ArtifactError::io("remove old uploads", error))?;
        Ok(Self { inner: Arc::new(Inner { folder, blobs, running: Mutex::default(), unnamed: AtomicU64::new(0) }) })
    }

    /// Number of stored bytes of an owner's interrupted upload. The next call continues the upload at this offset. Each
    /// owner has uploads of its own, so that nobody continues an upload of which another has sent the beginning.
    pub async fn received_bytes(&self, digest: &str, owner: &str) -> Result<u64> {
        check_digest(digest)?;
        let part = self.inner.folder.join(file_name(digest, owner));
        blocking(move || match fs::metadata(part) {
            Ok(metadata) => Ok(metadata.len()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
            Err(error) => Err(ArtifactError::io("read the size of an upload", error)),
        })
        .await
    }

    /// Starts an owner's upload of `size_bytes` in total (`offset_bytes` 0), or continues one (`offset_bytes` as
    /// returned by [`Self::received_bytes`]).
    ///
    /// # Errors
    ///
    /// [`ArtifactError::UploadBusy`] while another call uploads the same artifact for the same owner;
    /// [`ArtifactError::WrongOffset`]; [`ArtifactError::WrongSize`] if more than `size_bytes` are stored.
    pub async fn begin(&self, digest: &str, owner: &str, size_bytes: u64, offset_bytes: u64) -> Result<UploadWriter> {
        check_digest(digest)?;
        let file_name = file_name(digest, owner);
        if !self.running().insert(file_name.clone()) {
            return Err(ArtifactError::UploadBusy { digest: digest.to_owned() });
        }
        let lock = UploadLock { uploads: self.clone(), digest: Some(digest.to_owned()), file_name };
        let part = blocking(move || Part::open(lock, size_bytes, offset_bytes)).await?;
        Ok(UploadWriter { received_bytes: part.received_bytes, part: Some(part) })
    }

    /// Starts an upload of `size_bytes` whose digest [`UploadWriter::finish`] tells. It cannot be continued: if it ends
    /// early, what it received is removed.
    pub async fn begin_unnamed(&self, size_bytes: u64) -> Result<UploadWriter> {
        // The file of a server that died may have the same name; its content is discarded.
        let file_name = format!("unnamed-{}.part", self.inner.unnamed.fetch_add(1, Ordering::Relaxed));
        self.running().insert(file_name.clone());
        let lock = UploadLock { uploads: self.clone(), digest: None, file_name };
        let part = blocking(move || Part::open(lock, size_bytes, 0)).await?;
        Ok(UploadWriter { received_bytes: 0, part: Some(part) })
    }

    fn running(&self) -> MutexGuard<'_, HashSet<String>> {
        // The set is consistent even after a panic: the only operations on it are inserting and removing one entry.
        self.inner.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Name of the file of an owner's upload. Names of owners may contain any characters, so their hash stands for them.
fn file_name(digest: &str, owner: &str) -> String {
    format!("{digest}-{}.part", digest_of(owner.as_bytes()))
}

impl UploadWriter {
    /// Bytes received so far, including those of earlier calls.
    #[must_use]
    pub fn received_bytes(&self) -> u64 {
        self.received_bytes
    }

    /// Appends a chunk.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::WrongSize`] if more bytes arrive than were announced.
    pub async fn write(&mut self, chunk: Vec<u8>) -> Result<()> {
        let mut part = self.take_part()?;
        let part = blocking(move || part.append(&chunk).map(|()| part)).await?;
        self.received_bytes = part.received_bytes;
        self.part = Some(part);
        Ok(())
    }

    /// Checks size and digest, publishes the blob, and returns its digest. When this returns, the blob is on disk and
    /// must be recorded in the store.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::WrongSize`] if bytes are missing: a later call can send them. [`ArtifactError::WrongDigest`]:
    /// the upload is discarded. [`ArtifactError::Remote`]: a later call can continue at the end of an upload
    /// that has a digest.
    pub async fn finish(mut self) -> Result<String> {
        let part = self.take_part()?;
        blocking(move || part.publish()).await
    }

    fn take_part(&mut self) -> Result<Part> {
        let no_part = || ArtifactError::io("continue an upload", io::Error::other("an earlier write failed"));
        self.part.take().ok_or_else(no_part)
    }
}

impl Part {
    fn open(lock: UploadLock, size_bytes: u64, offset_bytes: u64) -> Result<Self> {
        let path = lock.uploads.inner.folder.join(&lock.file_name);
        let open = || -> io::Result<(File, u64)> {
            let file = private_file().read(true).write(true).create(true).truncate(false).open(&path)?;
            let stored_bytes = file.metadata()?.len();
            Ok((file, stored_bytes))
        };
        let (mut file, stored_bytes) = open().map_err(|error| ArtifactError::io("open an upload", error))?;
        if offset_bytes != 0 && offset_bytes != stored_bytes {
            return Err(ArtifactError::WrongOffset { offset_bytes, received_bytes: stored_bytes });
        }
        if offset_bytes > size_bytes {
            return Err(ArtifactError::WrongSize { received_bytes: offset_bytes, size_bytes });
        }
        let mut hash_stored = || -> io::Result<Sha256> {
            file.set_len(offset_bytes)?;
            file.seek(SeekFrom::Start(0))?;
            hash_rest(&mut file)
        };
        let hasher = hash_stored().map_err(|error| ArtifactError::io("continue an upload", error))?;
        Ok(Self { file, path, hasher, received_bytes: offset_bytes, size_bytes, lock })
    }

    fn append(&mut self, chunk: &[u8]) -> Result<()> {
        let received_bytes = self.received_bytes + chunk.len() as u64;
        if received_bytes > self.size_bytes {
            return Err(ArtifactError::WrongSize { received_bytes, size_bytes: self.size_bytes });
        }
        self.file.write_all(chunk).map_err(|error| ArtifactError::io("write an upload", error))?;
        self.hasher.update(chunk);
        self.received_bytes = received_bytes;
        Ok(())
    }

    fn publish(self) -> Result<String> {
        let Self { file, path, hasher, received_bytes, size_bytes, lock } = self;
        if received_bytes != size_bytes {
            return Err(ArtifactError::WrongSize { received_bytes, size_bytes });
        }
        let found = name(hasher);
        if let Some(digest) = lock.digest.clone().filter(|digest| *digest != found) {
            let removed = fail::point("file.remove").and_then(|()| fs::remove_file(&path));
            removed.map_err(|error| ArtifactError::io("remove an upload with a wrong digest", error))?;
            return Err(ArtifactError::WrongDigest { digest, found });
        }
        lock.uploads.inner.blobs.publish(&file, &path, &found)?;
        Ok(found)
    }
}

impl Drop for UploadLock {
    fn drop(&mut self) {
        if self.digest.is_none() {
            // A published file is no longer here. If the removal fails, a later start removes the file.
            drop(fs::remove_file(self.uploads.inner.folder.join(&self.file_name)));
        }
        self.uploads.running().remove(&self.file_name);
    }
}

/// Removes uploads that have not grown for [`UPLOAD_AGE_MAX`].
fn remove_stale(uploads: &Path) -> io::Result<()> {
    for file in fs::read_dir(uploads)? {
        let file = file?;
        let age = file.metadata()?.modified()?.elapsed().unwrap_or(Duration::ZERO);
        if age > UPLOAD_AGE_MAX {
            fs::remove_file(file.path())?;
        }
    }
    Ok(())
}
