//! Stores what the folder holds and the remote does not: files from a time when the folder was used without the remote.

use super::{Remote, identity};
use crate::error::{ArtifactError, Result};
use crate::folder::flush_folder;
use crate::inventory::{BlobKind, Inventory};
use crate::private::private_file;
use std::fs;
use std::io;
use std::path::Path;

/// File in the data folder that says that the folder was used without its remote since it was used with it.
const APART: &str = "remote.apart";

/// Notes that the folder is used without a remote, if it has one.
pub(crate) fn note_use_without(data_dir: &Path) -> Result<()> {
    let note = || -> io::Result<()> {
        if identity::kept(data_dir)?.is_some() {
            private_file().write(true).create(true).truncate(false).open(data_dir.join(APART))?.sync_all()?;
            flush_folder(data_dir)?;
        }
        Ok(())
    };
    note().map_err(|error| ArtifactError::io("note the use without the remote", error))
}

/// Stores the blobs of the folder in the remote, unless all its files have been there before. Then the folder is a
/// cache, from which files are removed.
pub(super) fn run(remote: &Remote, data_dir: &Path) -> Result<()> {
    let apart = data_dir.join(APART);
    let kept = identity::kept(data_dir).map_err(|error| ArtifactError::io("read the remote's name", error))?;
    if kept.is_some() && !apart.exists() {
        return Ok(());
    }
    let inventory = Inventory::of(data_dir);
    for kind in [BlobKind::Artifact, BlobKind::Checkpoint] {
        for digest in inventory.list(kind)? {
            if !remote.copies(kind, &digest)?.is_empty() {
                continue;
            }
            match remote.put_anew(kind, &digest, &mut inventory.open(kind, &digest)?) {
                // A damaged file is worth nothing.
                Ok(()) | Err(ArtifactError::DataLoss { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }
    let finish = || -> io::Result<()> {
        identity::keep(data_dir, remote.installation())?;
        match fs::remove_file(apart) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    };
    finish().map_err(|error| ArtifactError::io("keep the remote's name", error))
}
