//! Locks on files. The operating system releases them when the process ends, even after a crash.

use crate::error::ArtifactError;
use std::fs::{File, TryLockError};
use std::path::Path;

/// Locks the file.
///
/// # Errors
///
/// [`ArtifactError::Locked`] if it is locked already.
pub(crate) fn lock(path: &Path) -> Result<File, ArtifactError> {
    try_lock(path)?.ok_or_else(|| ArtifactError::Locked { path: path.to_owned() })
}

/// Locks the file; `None` if it is locked already.
pub(crate) fn try_lock(path: &Path) -> Result<Option<File>, ArtifactError> {
    let options = File::options().create(true).truncate(false).write(true).open(path);
    let file = options.map_err(|error| ArtifactError::io("open a lock file", error))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(ArtifactError::io("lock the data folder", error)),
    }
}

/// Waits for a shared lock on the file.
pub(crate) fn lock_shared(path: &Path) -> Result<File, ArtifactError> {
    let options = File::options().create(true).truncate(false).write(true).open(path);
    let file = options.map_err(|error| ArtifactError::io("open a lock file", error))?;
    file.lock_shared().map_err(|error| ArtifactError::io("lock the data folder", error))?;
    Ok(file)
}
