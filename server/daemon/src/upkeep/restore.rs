//! Creates a data folder from a backup.

use super::backup::{MANIFEST, Manifest, lock_empty, require_outside};
use super::keys::raise_after_restore;
use super::{Report, Result, UpkeepError, check};
use crate::database::DATABASE;
use lightpath_artifacts::{ArtifactError, BlobKind, Inventory, digest_of_file, private_file};
use lightpath_fail_points as fail;
use lightpath_store::{Inspection, Store};
use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Copies a backup to `data_dir`, a folder that is empty or does not exist, and checks the copy. The backup does not
/// change. Until this returns, no server can be started on the folder. Then the data is on disk and a server can use
/// it.
///
/// # Errors
///
/// [`UpkeepError::NoBackup`], [`UpkeepError::NotEmpty`], [`UpkeepError::Inside`]; [`ArtifactError::Locked`] if another
/// process uses the folder. Missing and damaged files of the backup are in the report, and everything else is restored.
pub async fn restore(backup: &Path, data_dir: &Path) -> Result<Report> {
    let manifest = read_manifest(backup)?;
    let database = backup.join(DATABASE);
    let found = digest_of_file(&database)?;
    if found != manifest.database {
        let problem = format!("{DATABASE} hashes to {found}, but {MANIFEST} says {}", manifest.database);
        return Err(UpkeepError::NoBackup { path: backup.to_owned(), problem });
    }
    require_outside(data_dir, backup)?;
    let _lock = lock_empty(data_dir)?;
    let (from, to) = (Inventory::of(backup), Inventory::create(data_dir)?);
    for kind in [BlobKind::Artifact, BlobKind::Checkpoint] {
        for digest in from.list(kind)? {
            match from.copy(kind, &digest, &to) {
                // The check at the end finds what is missing then.
                Ok(_) | Err(ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
    // The database is copied last, so that an incomplete folder has no database and is never taken for a complete one.
    let (copy, partial) = (data_dir.join(DATABASE), data_dir.join("lightpath.db.partial"));
    let copied = private_file()
        .write(true)
        .create_new(true)
        .open(&partial)
        .and_then(|mut file| io::copy(&mut File::open(&database)?, &mut file))
        .map(drop);
    copied.map_err(UpkeepError::io("copy the database to", &copy))?;
    // This refuses a database of a newer program now and not when the server starts.
    Inspection::open(&partial).await?.close().await?;
    let store = Store::open_shared(&partial).await?;
    raise_after_restore(&store, store.now_ms()).await?;
    store.close().await;
    let renamed = fail::point("restore.flush")
        .and_then(|()| File::open(&partial)?.sync_all())
        .and_then(|()| fail::point("restore.rename"))
        .and_then(|()| fs::rename(&partial, &copy));
    renamed.map_err(UpkeepError::io("copy the database to", &copy))?;
    to.flush()?;
    check(data_dir).await
}

fn read_manifest(backup: &Path) -> Result<Manifest> {
    let no_backup = |problem: String| UpkeepError::NoBackup { path: backup.to_owned(), problem };
    let text = fs::read_to_string(backup.join(MANIFEST)).map_err(|error| {
        no_backup(format!("{MANIFEST} cannot be read ({error}); every complete backup has this file"))
    })?;
    serde_json::from_str(&text).map_err(|error| no_backup(format!("{MANIFEST} is invalid ({error})")))
}
