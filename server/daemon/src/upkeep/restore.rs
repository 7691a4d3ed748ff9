//! Creates a data folder from a backup.

use super::backup::{MANIFEST, Manifest, lock_empty, require_only, require_outside};
use super::keys::raise_after_restore;
use super::{Report, RestoredTokens, Result, UpkeepError, check};
use crate::database::DATABASE;
use lightpath_artifacts::{
    ArtifactError, BlobKind, FolderLock, Inventory, LOCK, RESTORING, digest_of_file, private_file,
};
use lightpath_fail_points as fail;
use lightpath_store::{Inspection, Store};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Name of the database until the copy is complete.
const PARTIAL: &str = "lightpath.db.partial";

/// Copies a backup to `data_dir`, and checks the copy. The folder is empty, does not exist, or holds what a restore left
/// that did not end, which this one replaces. The backup does not change. Until this returns, no server can be started on
/// the folder; if this process dies before, none can be started until another restore has ended. `tokens` says what becomes
/// of the tokens that the backup accepts.
///
/// # Errors
///
/// [`UpkeepError::NoBackup`], [`UpkeepError::NotEmpty`], [`UpkeepError::Inside`]; [`UpkeepError::TokensUndecided`],
/// [`UpkeepError::UnknownTokens`]; [`ArtifactError::Locked`] if another process uses the folder. Missing and damaged files of the backup are in the report, and everything else is restored.
pub async fn restore(backup: &Path, data_dir: &Path, tokens: &RestoredTokens) -> Result<Report> {
    let manifest = read_manifest(backup)?;
    require_outside(data_dir, backup)?;
    let _lock = begin(data_dir)?;
    let (from, to) = (Inventory::of(backup), Inventory::create(data_dir)?);
    to.clear()?;
    copy_database(backup, &data_dir.join(PARTIAL), &manifest)?;
    prepare_database(&data_dir.join(PARTIAL), tokens).await?;
    for kind in [BlobKind::Artifact, BlobKind::Checkpoint] {
        for digest in from.list(kind)? {
            match from.copy(kind, &digest, &to) {
                // The check at the end finds what is missing then.
                Ok(_) | Err(ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
    publish_database(data_dir)?;
    to.flush()?;
    end(data_dir, &to)?;
    check(data_dir).await
}

/// Locks the folder of a restore, and notes in it that the restore has begun. Removes the databases of an earlier restore
/// that did not end.
fn begin(data_dir: &Path) -> Result<FolderLock> {
    let note = data_dir.join(RESTORING);
    let lock = match note.exists() {
        false => lock_empty(data_dir)?,
        true => {
            let lock = FolderLock::take_to_restore(data_dir)?;
            require_only(data_dir, is_from_restore)?;
            lock
        }
    };
    // The note must be on disk before any file that a server could take for its own.
    let noted = private_file().write(true).create(true).truncate(false).open(&note).and_then(|file| {
        fail::point("restore.begin")?;
        file.sync_all()?;
        File::open(data_dir)?.sync_all()
    });
    noted.map_err(UpkeepError::io("write", &note))?;
    for entry in fs::read_dir(data_dir).map_err(UpkeepError::io("read the folder", data_dir))? {
        let path = entry.map_err(UpkeepError::io("read the folder", data_dir))?.path();
        if path.is_file() && path != note && path != data_dir.join(LOCK) {
            fs::remove_file(&path).map_err(UpkeepError::io("remove", &path))?;
        }
    }
    Ok(lock)
}

/// Notes that a restore has ended. The flush makes the removal of the note durable.
fn end(data_dir: &Path, to: &Inventory) -> Result<()> {
    let note = data_dir.join(RESTORING);
    let removed = fail::point("restore.end").and_then(|()| fs::remove_file(&note));
    removed.map_err(UpkeepError::io("remove", &note))?;
    Ok(to.flush()?)
}

/// Whether a restore makes a file or folder of this name.
fn is_from_restore(name: &OsStr) -> bool {
    let folders = [LOCK, RESTORING, "artifacts", "checkpoints", "tmp"];
    folders.iter().any(|folder| name == *folder) || name.to_string_lossy().starts_with(DATABASE)
}

/// Copies the database of a backup, and compares the copy with the manifest.
fn copy_database(backup: &Path, partial: &Path, manifest: &Manifest) -> Result<()> {
    let copied = private_file()
        .write(true)
        .create_new(true)
        .open(partial)
        .and_then(|mut file| io::copy(&mut File::open(backup.join(DATABASE))?, &mut file));
    copied.map_err(UpkeepError::io("copy the database to", partial))?;
    match digest_of_file(partial)? {
        found if found == manifest.database => Ok(()),
        found => {
            let problem = format!("{DATABASE} hashes to {found}, but {MANIFEST} says {}", manifest.database);
            Err(UpkeepError::NoBackup { path: backup.to_owned(), problem })
        }
    }
}

/// Prepares the copied database for a server.
async fn prepare_database(partial: &Path, tokens: &RestoredTokens) -> Result<()> {
    // This refuses a database of a newer program now and not when the server starts.
    Inspection::open(partial).await?.close().await?;
    let store = Store::open_shared(partial).await?;
    let now_ms = store.now_ms();
    let settled = tokens.settle(&store, now_ms).await;
    if settled.is_ok() {
        raise_after_restore(&store, now_ms).await?;
    }
    store.close().await;
    settled
}

/// Gives the database its name.
fn publish_database(data_dir: &Path) -> Result<()> {
    let (copy, partial) = (data_dir.join(DATABASE), data_dir.join(PARTIAL));
    let renamed = fail::point("restore.flush")
        .and_then(|()| File::open(&partial)?.sync_all())
        .and_then(|()| fail::point("restore.rename"))
        .and_then(|()| fs::rename(&partial, &copy));
    renamed.map_err(UpkeepError::io("copy the database to", &copy))
}

fn read_manifest(backup: &Path) -> Result<Manifest> {
    let no_backup = |problem: String| UpkeepError::NoBackup { path: backup.to_owned(), problem };
    let text = fs::read_to_string(backup.join(MANIFEST)).map_err(|error| {
        no_backup(format!("{MANIFEST} cannot be read ({error}); every complete backup has this file"))
    })?;
    serde_json::from_str(&text).map_err(|error| no_backup(format!("{MANIFEST} is invalid ({error})")))
}
