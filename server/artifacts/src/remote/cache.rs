//! The bound on local copies: the files that were not used for the longest time are removed first.

use crate::error::{ArtifactError, Result};
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// The local copies of blobs that are in the remote. A file that is open can be removed: whoever reads it reads on.
#[derive(Debug)]
pub(crate) struct Cache {
    bytes_max: u64,
    files: Mutex<Files>,
}

#[derive(Debug, Default)]
struct Files {
    bytes: u64,
    /// Number of uses so far.
    uses: u64,
    /// Size \[bytes\] and last use of each file.
    known: HashMap<PathBuf, (u64, u64)>,
    by_use: BTreeMap<u64, PathBuf>,
}

impl Cache {
    /// The cache with the files of these folders of blobs, of which the last written count as the last used.
    pub(crate) fn open(bytes_max: u64, roots: &[&Path]) -> io::Result<Self> {
        let mut found: Vec<(SystemTime, PathBuf, u64)> = Vec::new();
        for root in roots {
            for shard in fs::read_dir(root)? {
                let shard = shard?;
                if !shard.file_type()?.is_dir() {
                    continue;
                }
                for file in fs::read_dir(shard.path())? {
                    let file = file?;
                    let metadata = file.metadata()?;
                    found.push((metadata.modified()?, file.path(), metadata.len()));
                }
            }
        }
        found.sort();
        let cache = Self { bytes_max, files: Mutex::default() };
        for (_, path, bytes) in found {
            cache.insert(&path, bytes)?;
        }
        Ok(cache)
    }

    /// Counts a file that has just been written, and removes others until the cache keeps its bound.
    pub(crate) fn insert(&self, path: &Path, bytes: u64) -> io::Result<()> {
        let mut files = self.files();
        files.forget(path);
        files.uses += 1;
        let use_ = files.uses;
        files.bytes += bytes;
        files.known.insert(path.to_owned(), (bytes, use_));
        files.by_use.insert(use_, path.to_owned());
        while files.bytes > self.bytes_max && files.known.len() > 1 {
            files.remove_oldest()?;
        }
        Ok(())
    }

    /// Size of all files \[bytes\].
    pub(crate) fn bytes(&self) -> u64 {
        self.files().bytes
    }

    /// Removes the file that was not used for the longest time; `false` if there is none.
    pub(crate) fn remove_oldest(&self) -> Result<bool> {
        let removed = self.files().remove_oldest();
        removed.map_err(|error| ArtifactError::io("remove a local copy", error))
    }

    /// Notes that a file was used.
    pub(crate) fn touch(&self, path: &Path) {
        let mut files = self.files();
        files.uses += 1;
        let now = files.uses;
        let Some((_, last)) = files.known.get_mut(path) else { return };
        let last = std::mem::replace(last, now);
        files.by_use.remove(&last);
        files.by_use.insert(now, path.to_owned());
    }

    /// Notes that a file was removed.
    pub(crate) fn forget(&self, path: &Path) {
        self.files().forget(path);
    }

    fn files(&self) -> MutexGuard<'_, Files> {
        // Only sizes and uses can be wrong after a panic, until the next start.
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Files {
    fn remove_oldest(&mut self) -> io::Result<bool> {
        let Some(oldest) = self.by_use.values().next().cloned() else { return Ok(false) };
        match fs::remove_file(&oldest) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => {
                self.forget(&oldest);
                Ok(true)
            }
        }
    }

    fn forget(&mut self, path: &Path) {
        if let Some((bytes, last)) = self.known.remove(path) {
            self.bytes -= bytes;
            self.by_use.remove(&last);
        }
    }
}
