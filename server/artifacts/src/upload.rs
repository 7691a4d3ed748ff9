//! Resumable uploads: the received part of an interrupted upload is kept, and a later call continues it. An upload whose
//! digest nobody knows yet cannot be found again, so that nothing of it is kept.

use crate::blobs::Blobs;
use crate::blocking::blocking;
use crate::claim::Claim;
use crate::digest::{check_digest, name};
use crate::error::{ArtifactError, Result};
use crate::folder::hash_rest;
use crate::interrupted::{Kept, file_name};
use crate::private::private_file;
use crate::space::Space;
use lightpath_fail_points as fail;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// An upload that may begin: no other call continues it, and its room is claimed.
#[derive(Debug)]
pub struct UploadTurn {
    lock: UploadLock,
    size_bytes: u64,
    offset_bytes: u64,
}

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
    space: Arc<Space>,
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
pub(crate) struct UploadLock {
    uploads: Uploads,
    /// `None`: nobody knows the digest yet, so the file is removed with the lock.
    digest: Option<String>,
    file_name: String,
    /// What of the file is hashed; `None` as long as that is unknown.
    progress: Option<Progress>,
    /// Size of the interrupted upload that is continued \[bytes\], and the time since which it has not grown.
    taken: Option<(u64, SystemTime)>,
    /// Room of the upload; `None` as long as it is not claimed.
    claim: Option<Claim>,
}

/// The hash of the received bytes.
#[derive(Debug)]
struct Progress {
    received_bytes: u64,
    hasher: Sha256,
}

impl Uploads {
    /// Uploads whose received parts are in `folder`, and whose blobs go to `blobs`.
    pub(crate) fn new(folder: PathBuf, space: Arc<Space>, blobs: Arc<Blobs>) -> Self {
        let (running, unnamed) = (Mutex::default(), AtomicU64::new(0));
        Self { inner: Arc::new(Inner { folder, space, blobs, running, unnamed }) }
    }

    /// Removes interrupted uploads that have not grown for [`UPLOAD_AGE_MAX`](crate::UPLOAD_AGE_MAX).
    pub async fn remove_old(&self) -> Result<()> {
        let uploads = self.clone();
        blocking(move || {
            uploads.inner.space.interrupted().remove_old(SystemTime::now());
            Ok(())
        })
        .await
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

    /// Takes the turn of an owner's upload of `size_bytes` in total (`offset_bytes` 0), or of one that continues
    /// (`offset_bytes` as returned by [`Self::received_bytes`]), and claims its room. `counted_bytes` count towards the
    /// limits on what is stored.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::UploadBusy`] while another call uploads the same artifact for the same owner;
    /// [`ArtifactError::WrongOffset`]; [`ArtifactError::WrongSize`] if more than `size_bytes` are stored; those of
    /// [`Claim::take`].
    pub async fn turn(
        &self,
        digest: &str,
        owner: &str,
        (size_bytes, counted_bytes): (u64, u64),
        offset_bytes: u64,
    ) -> Result<UploadTurn> {
        check_digest(digest)?;
        let lock = self.lock(file_name(digest, owner), Some(digest))?;
        let owner = owner.to_owned();
        blocking(move || UploadTurn::take(lock, &owner, (size_bytes, counted_bytes), offset_bytes)).await
    }

    /// Starts or continues an upload like [`Self::turn`], all of whose bytes count as stored.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::turn`].
    pub async fn begin(&self, digest: &str, owner: &str, size_bytes: u64, offset_bytes: u64) -> Result<UploadWriter> {
        self.turn(digest, owner, (size_bytes, size_bytes), offset_bytes).await?.open().await
    }

    /// Takes the turn of an upload of `size_bytes` whose digest [`UploadWriter::finish`] tells, and claims its room. It
    /// cannot be continued: if it ends early, what it received is removed.
    ///
    /// # Errors
    ///
    /// Those of [`Claim::take`].
    pub async fn turn_unnamed(&self, owner: &str, size_bytes: u64) -> Result<UploadTurn> {
        let number = self.inner.unnamed.fetch_add(1, Ordering::Relaxed);
        let lock = self.lock(format!("unnamed-{number}.part"), None)?;
        let owner = owner.to_owned();
        blocking(move || UploadTurn::take(lock, &owner, (size_bytes, size_bytes), 0)).await
    }

    fn lock(&self, file_name: String, digest: Option<&str>) -> Result<UploadLock> {
        if !self.running().insert(file_name.clone()) {
            return Err(ArtifactError::UploadBusy { digest: digest.unwrap_or_default().to_owned() });
        }
        let (uploads, digest) = (self.clone(), digest.map(str::to_owned));
        Ok(UploadLock { uploads, digest, file_name, progress: None, taken: None, claim: None })
    }

    fn running(&self) -> MutexGuard<'_, HashSet<String>> {
        // The set is consistent even after a panic: the only operations on it are inserting and removing one entry.
        self.inner.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl UploadTurn {
    /// Checks the offset and claims the room.
    fn take(
        mut lock: UploadLock,
        owner: &str,
        (size_bytes, counted_bytes): (u64, u64),
        offset_bytes: u64,
    ) -> Result<Self> {
        let space = Arc::clone(&lock.uploads.inner.space);
        let kept = space.interrupted().take(&lock.file_name);
        lock.taken = kept.as_ref().map(|kept| (kept.size_bytes, kept.since));
        let received_bytes = lock.taken.map_or(0, |(size_bytes, _)| size_bytes);
        lock.progress = kept.and_then(|Kept { hasher, .. }| Some(Progress { received_bytes, hasher: hasher? }));
        if offset_bytes != 0 && offset_bytes != received_bytes {
            return Err(ArtifactError::WrongOffset { offset_bytes, received_bytes });
        }
        if offset_bytes > size_bytes {
            return Err(ArtifactError::WrongSize { received_bytes: offset_bytes, size_bytes });
        }
        if offset_bytes == 0 {
            lock.discard();
        }
        lock.claim = Some(Claim::take(&space, owner, counted_bytes, size_bytes - offset_bytes)?);
        Ok(Self { lock, size_bytes, offset_bytes })
    }

    /// The room of the upload.
    ///
    /// # Panics
    ///
    /// Never: a turn has a claim.
    #[must_use]
    pub fn claim(&self) -> &Claim {
        self.lock.claim.as_ref().expect("a turn has a claim")
    }

    /// Begins to write.
    pub async fn open(self) -> Result<UploadWriter> {
        let part = blocking(move || Part::open(self)).await?;
        Ok(UploadWriter { received_bytes: part.received_bytes(), part: Some(part) })
    }
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
    /// [`ArtifactError::WrongSize`] if more bytes arrive than were announced; [`ArtifactError::DiskLow`] if others have
    /// filled the disk in the meantime.
    pub async fn write(&mut self, chunk: Vec<u8>) -> Result<()> {
        let mut part = self.take_part()?;
        let part = blocking(move || part.append(&chunk).map(|()| part)).await?;
        self.received_bytes = part.received_bytes();
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
    pub async fn finish(self) -> Result<String> {
        Ok(self.finish_claimed().await?.0)
    }

    /// Does the same as [`Self::finish`], and returns also the lock, which holds the room until the blob is recorded.
    pub(crate) async fn finish_claimed(mut self) -> Result<(String, UploadLock)> {
        let part = self.take_part()?;
        blocking(move || part.publish()).await
    }

    fn take_part(&mut self) -> Result<Part> {
        let no_part = || ArtifactError::io("continue an upload", io::Error::other("an earlier write failed"));
        self.part.take().ok_or_else(no_part)
    }
}

impl Part {
    fn open(turn: UploadTurn) -> Result<Self> {
        let UploadTurn { mut lock, size_bytes, offset_bytes } = turn;
        let path = lock.path();
        let known = lock.progress.take().filter(|progress| progress.received_bytes == offset_bytes);
        let open = || -> io::Result<(File, Sha256)> {
            let mut file = private_file().read(true).write(true).create(true).truncate(false).open(&path)?;
            file.set_len(offset_bytes)?;
            let hasher = match known {
                Some(progress) => progress.hasher,
                None => hash_rest(&mut file)?,
            };
            file.seek(SeekFrom::Start(offset_bytes))?;
            Ok((file, hasher))
        };
        let (file, hasher) = open().map_err(|error| ArtifactError::io("continue an upload", error))?;
        lock.progress = Some(Progress { received_bytes: offset_bytes, hasher });
        Ok(Self { file, path, size_bytes, lock })
    }

    fn received_bytes(&self) -> u64 {
        self.lock.progress.as_ref().map_or(0, |progress| progress.received_bytes)
    }

    fn append(&mut self, chunk: &[u8]) -> Result<()> {
        let received_bytes = self.received_bytes() + chunk.len() as u64;
        if received_bytes > self.size_bytes {
            return Err(ArtifactError::WrongSize { received_bytes, size_bytes: self.size_bytes });
        }
        let claim = self.lock.claim.as_mut();
        claim.as_ref().map_or(Ok(()), |claim| claim.require_disk())?;
        self.file.write_all(chunk).map_err(|error| ArtifactError::io("write an upload", error))?;
        if let Some(claim) = claim {
            claim.wrote(chunk.len() as u64);
        }
        if let Some(progress) = &mut self.lock.progress {
            progress.hasher.update(chunk);
            progress.received_bytes = received_bytes;
        }
        Ok(())
    }

    fn publish(self) -> Result<(String, UploadLock)> {
        let (received_bytes, size_bytes) = (self.received_bytes(), self.size_bytes);
        let Self { file, path, lock, .. } = self;
        if received_bytes != size_bytes {
            return Err(ArtifactError::WrongSize { received_bytes, size_bytes });
        }
        let found = name(lock.progress.as_ref().map_or_else(Sha256::new, |progress| progress.hasher.clone()));
        if let Some(digest) = lock.digest.clone().filter(|digest| *digest != found) {
            let removed = fail::point("file.remove").and_then(|()| fs::remove_file(&path));
            removed.map_err(|error| ArtifactError::io("remove an upload with a wrong digest", error))?;
            return Err(ArtifactError::WrongDigest { digest, found });
        }
        lock.uploads.inner.blobs.publish(&file, &path, &found)?;
        Ok((found, lock))
    }
}

impl UploadLock {
    /// The room of the upload.
    pub(crate) fn claim(&self) -> Option<&Claim> {
        self.claim.as_ref()
    }

    fn path(&self) -> PathBuf {
        self.uploads.inner.folder.join(&self.file_name)
    }

    /// Removes what was received.
    fn discard(&mut self) {
        self.progress = None;
        // If the removal fails, the next call or the next start discards the file.
        drop(fs::remove_file(self.path()));
    }

    /// Keeps what was received for a later call. A published file is no longer here.
    fn keep(&mut self) {
        let Ok(size_bytes) = fs::metadata(self.path()).map(|metadata| metadata.len()) else { return };
        if size_bytes == 0 {
            return self.discard();
        }
        // After a write that failed half way, the file has more bytes than were hashed.
        let hashed = self.progress.take().filter(|progress| progress.received_bytes == size_bytes);
        let unchanged = self.taken.filter(|&(taken_bytes, _)| taken_bytes == size_bytes);
        let since = unchanged.map_or_else(SystemTime::now, |(_, since)| since);
        let kept = Kept { size_bytes, since, hasher: hashed.map(|progress| progress.hasher) };
        self.uploads.inner.space.interrupted().keep(&self.file_name, kept);
    }
}

impl Drop for UploadLock {
    fn drop(&mut self) {
        // Before another call may take the turn.
        match self.digest {
            Some(_) => self.keep(),
            None => self.discard(),
        }
        self.claim = None;
        self.uploads.running().remove(&self.file_name);
    }
}
