//! Locks on files. The operating system releases them when the process ends, even after a crash.

use crate::error::{ArtifactError, Result};
use crate::private::{create_private_folder, private_file};
use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

/// Name of the lock file in a data folder.
pub const LOCK: &str = "lock";

/// Name of the file that says that a restore into the folder has begun and has not ended.
pub const RESTORING: &str = "restore.unfinished";

/// The lock of a data folder. Only one process can hold it: a server, or a command that changes the folder as a whole.
#[derive(Debug)]
pub struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Locks `data_dir`, which is created if it does not exist. Dropping the returned value unlocks it.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Locked`] if another process holds the lock; [`ArtifactError::Unfinished`] if a restore into the
    /// folder died.
    pub fn take(data_dir: &Path) -> Result<Self> {
        let lock = Self::take_to_restore(data_dir)?;
        match data_dir.join(RESTORING).exists() {
            true => Err(ArtifactError::Unfinished { path: data_dir.to_owned() }),
            false => Ok(lock),
        }
    }

    /// Locks `data_dir` like [`Self::take`], also if a restore into it died.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::Locked`] if another process holds the lock.
    pub fn take_to_restore(data_dir: &Path) -> Result<Self> {
        create_private_folder(data_dir).map_err(|error| ArtifactError::io("create the data folder", error))?;
        let path = data_dir.join(LOCK);
        let file = try_lock(&path)?.ok_or(ArtifactError::Locked { path })?;
        Ok(Self { _file: file })
    }
}

/// Locks the file; `None` if it is locked already.
pub(crate) fn try_lock(path: &Path) -> Result<Option<File>> {
    let opened = private_file().create(true).truncate(false).write(true).open(path);
    let file = opened.map_err(|error| ArtifactError::io("open a lock file", error))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(ArtifactError::io("lock the data folder", error)),
    }
}

/// Waits for a shared lock on the file; `None` if the file does not exist and cannot be created, as on read-only media.
pub(crate) fn lock_shared(path: &Path) -> Result<Option<File>> {
    let opened = private_file().create(true).truncate(false).write(true).open(path);
    let opened = match opened {
        Err(error) if is_unwritable(&error) => File::open(path),
        opened => opened,
    };
    let file = match opened {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        opened => opened.map_err(|error| ArtifactError::io("open a lock file", error))?,
    };
    file.lock_shared().map_err(|error| ArtifactError::io("lock the data folder", error))?;
    Ok(Some(file))
}

fn is_unwritable(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem)
}
