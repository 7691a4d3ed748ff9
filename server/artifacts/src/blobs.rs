//! Blobs of one kind: a local folder, and, if there is a remote, the copies there. With a remote the folder is a cache: a
//! file in it has been stored in the remote before it got its name. All functions block.

use crate::claim::Claim;
use crate::error::{ArtifactError, Result};
use crate::folder::{Folder, Stamp};
use crate::inventory::BlobKind;
use crate::remote::Remote;
use crate::remote::cache::Cache;
use crate::space::Space;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

#[derive(Debug)]
pub(super) struct Blobs {
    kind: BlobKind,
    folder: Folder,
    behind: Option<Behind>,
}

/// What is behind the local folder.
#[derive(Debug)]
struct Behind {
    remote: Arc<Remote>,
    cache: Arc<Cache>,
    space: Arc<Space>,
    /// Held while a blob is fetched whose digest begins with this byte, so that no blob is fetched twice at a time.
    fetching: Vec<Mutex<()>>,
}

impl Blobs {
    pub(super) fn new(
        kind: BlobKind,
        folder: Folder,
        space: &Arc<Space>,
        remote: Option<(Arc<Remote>, Arc<Cache>)>,
    ) -> Self {
        let fetching = || (0..=u8::MAX).map(|_| Mutex::default()).collect();
        let behind =
            remote.map(|(remote, cache)| Behind { remote, cache, space: Arc::clone(space), fetching: fetching() });
        Self { kind, folder, behind }
    }

    /// Stores bytes and returns their digest. The bytes are on disk, and in the remote, when this returns.
    pub(super) fn put(&self, bytes: &[u8]) -> Result<String> {
        let digest = self.folder.put(bytes, |path, digest| self.store(path, digest))?;
        self.keep(&digest, bytes.len() as u64)?;
        Ok(digest)
    }

    /// Flushes a complete file to disk, stores it in the remote, and renames it to its digest, which the caller has
    /// checked. If the remote fails, the file stays as it is.
    pub(super) fn publish(&self, file: &File, path: &Path, digest: &str) -> Result<()> {
        let size_bytes = file.metadata().map_err(|error| ArtifactError::io("read the size of a file", error))?.len();
        self.folder.publish(file, path, digest, |path, digest| self.store(path, digest))?;
        self.keep(digest, size_bytes)
    }

    /// Reads a whole blob and checks it against its digest.
    pub(super) fn read(&self, digest: &str) -> Result<Vec<u8>> {
        self.local_or_fetched(
            digest,
            |folder| folder.read(digest),
            |(mut file, size_bytes)| {
                let mut bytes = Vec::with_capacity(usize::try_from(size_bytes).unwrap_or(0));
                file.read_to_end(&mut bytes).map_err(|error| ArtifactError::io("read a file", error))?;
                Ok(bytes)
            },
        )
    }

    /// Opens a blob, checks its content, and returns the file, positioned at its start, and its size \[bytes\].
    pub(super) fn open_verified(&self, digest: &str) -> Result<(File, u64)> {
        self.local_or_fetched(digest, |folder| folder.open_verified(digest), Ok)
    }

    /// Opens a blob. The content of a local file is not checked.
    pub(super) fn open(&self, digest: &str) -> Result<(File, u64)> {
        self.local_or_fetched(digest, |folder| folder.open(digest), Ok)
    }

    /// Size of a blob \[bytes\]; `None` if there is none.
    pub(super) fn size(&self, digest: &str) -> Result<Option<u64>> {
        match (self.folder.size(digest)?, &self.behind) {
            (None, Some(behind)) => {
                Ok(behind.remote.copies(self.kind, digest)?.first().map(|object| object.size_bytes))
            }
            (size_bytes, _) => Ok(size_bytes),
        }
    }

    /// Size and last change of the local file; `None` if there is none.
    pub(super) fn stamp(&self, digest: &str) -> Result<Option<Stamp>> {
        self.folder.stamp(digest)
    }

    /// Whether a blob without a local file certainly does not exist.
    pub(super) fn is_only_local(&self) -> bool {
        self.behind.is_none()
    }

    /// Whether a blob that was found intact is also in the remote, if there is one.
    pub(super) fn is_stored(&self, digest: &str) -> Result<bool> {
        let Some(behind) = &self.behind else { return Ok(true) };
        Ok(!behind.remote.copies(self.kind, digest)?.is_empty())
    }

    /// Removes a blob: its local file and all copies in the remote.
    pub(super) fn delete(&self, digest: &str) -> Result<()> {
        if let Some(behind) = &self.behind {
            let objects = behind.remote.objects(self.kind, digest)?;
            behind.remote.delete(self.kind, digest, &objects)?;
            behind.cache.forget(&self.folder.path(digest)?);
        }
        self.folder.delete(digest)
    }

    /// Digests of all local files.
    pub(super) fn list(&self) -> Result<Vec<String>> {
        self.folder.list()
    }

    /// Stores another copy in the remote from the local file.
    pub(super) fn store_anew(&self, digest: &str) -> Result<()> {
        let Some(behind) = &self.behind else { return Ok(()) };
        let put =
            self.folder.open(digest).and_then(|(mut file, _)| behind.remote.put_anew(self.kind, digest, &mut file));
        match put {
            Ok(()) => Ok(()),
            Err(ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => {
                let problem = io::Error::other("the local copy is gone; send the bytes again");
                Err(ArtifactError::remote("store a blob again", problem))
            }
            Err(error) => Err(error),
        }
    }

    /// Stores a copy in the remote from the local file if the remote has none.
    pub(super) fn ensure_stored(&self, digest: &str) -> Result<()> {
        if self.is_stored(digest)? { Ok(()) } else { self.store_anew(digest) }
    }

    /// Stores a copy in the remote from a file that has no name yet, if the remote has none.
    fn store(&self, path: &Path, digest: &str) -> Result<()> {
        let Some(behind) = &self.behind else { return Ok(()) };
        if !behind.remote.copies(self.kind, digest)?.is_empty() {
            return Ok(());
        }
        let mut file = File::open(path).map_err(|error| ArtifactError::io("open a file", error))?;
        behind.remote.put_anew(self.kind, digest, &mut file)
    }

    /// Counts a new local file, and keeps the bound of the cache.
    fn keep(&self, digest: &str, size_bytes: u64) -> Result<()> {
        let Some(behind) = &self.behind else { return Ok(()) };
        let kept = behind.cache.insert(&self.folder.path(digest)?, size_bytes);
        kept.map_err(|error| ArtifactError::io("remove a local copy", error))
    }

    /// Reads the local file, or, if it is missing or damaged, fetches the blob and passes its file on.
    fn local_or_fetched<T>(
        &self,
        digest: &str,
        local: impl Fn(&Folder) -> Result<T>,
        fetched: impl FnOnce((File, u64)) -> Result<T>,
    ) -> Result<T> {
        let Some(behind) = &self.behind else { return local(&self.folder) };
        let try_local = || match local(&self.folder) {
            Err(ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => Ok(None),
            read => {
                behind.cache.touch(&self.folder.path(digest)?);
                read.map(Some)
            }
        };
        if let Some(read) = try_local()? {
            return Ok(read);
        }
        let byte = digest.get(7..9).and_then(|hex| usize::from_str_radix(hex, 16).ok()).unwrap_or(0);
        let turn = behind.fetching[byte].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(read) = try_local()? {
            return Ok(read);
        }
        let file = self.fetch(behind, digest)?;
        drop(turn);
        fetched(file)
    }

    /// Fetches a blob from the remote into the folder, and returns its file, positioned at its start, and its size.
    fn fetch(&self, behind: &Behind, digest: &str) -> Result<(File, u64)> {
        // The room is held until the cache counts the file.
        let mut claim = None;
        let (mut file, size_bytes) = self.folder.receive_from(digest, |file| {
            let mut copy = Copying { file, claim: &mut claim, space: &behind.space };
            behind.remote.fetch(self.kind, digest, &mut copy, Copying::begin, Copying::append)
        })?;
        file.seek(SeekFrom::Start(0)).map_err(|error| ArtifactError::io("read a file", error))?;
        self.keep(digest, size_bytes)?;
        Ok((file, size_bytes))
    }
}

/// A local file that is being fetched, and its room on the disk.
struct Copying<'a> {
    file: &'a mut File,
    claim: &'a mut Option<Claim>,
    space: &'a Arc<Space>,
}

impl Copying<'_> {
    /// Begins with another copy.
    fn begin(&mut self, size_bytes: u64) -> Result<()> {
        let emptied = self.file.seek(SeekFrom::Start(0)).and_then(|_| self.file.set_len(0));
        emptied.map_err(|error| ArtifactError::io("write a file", error))?;
        // The room of the copy before comes back first.
        *self.claim = None;
        *self.claim = Some(Claim::for_copy(self.space, size_bytes)?);
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> Result<()> {
        self.claim.as_ref().map_or(Ok(()), Claim::require_disk)?;
        self.file.write_all(bytes).map_err(|error| ArtifactError::io("write a file", error))?;
        if let Some(claim) = self.claim {
            claim.wrote(bytes.len() as u64);
        }
        Ok(())
    }
}
