//! A consistent copy of a data folder that a server may be using.
//!
//! The database is copied as of one moment (`vacuum into`), then every blob that this copy refers to. Blobs never
//! change, and the server removes no artifact during the copy, so no artifact of the copy can be missing. Checkpoints
//! can be removed during the copy: a job whose saved state is missing starts from the beginning after a restore, with
//! the same result.

use super::blob_reader::blob_problem;
use super::{Finding, FindingKind, Result, UpkeepError};
use crate::database::{DATABASE, DatabaseError};
use lightpath_artifacts::{
    ArtifactError, BlobKind, FolderLock, Inventory, LOCK, create_private_folder, digest_of_file, private_file,
};
use lightpath_fail_points as fail;
use lightpath_store::Inspection;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Name of the manifest. It is written last, so a folder that has it is a complete backup.
pub(super) const MANIFEST: &str = "backup.json";

/// Manifest of a complete backup.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the program.
    pub version: String,
    /// Time when the database was copied \[ms since 1970\].
    pub time_ms: u64,
    /// Digest of the database: `sha256-…`.
    pub database: String,
    /// Number of recorded artifacts, including the damaged ones.
    pub artifacts: u64,
    /// Size of all recorded artifacts \[bytes\].
    pub artifact_bytes: u64,
    /// Number of jobs in all states.
    pub jobs: u64,
    /// Digests of the recorded artifacts that the backup lacks, because their files were missing or damaged.
    pub damaged: Vec<String>,
}

/// Result of a backup.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Backup {
    /// The manifest as it was written.
    pub manifest: Manifest,
    /// Number of jobs that start from the beginning after a restore, because their saved states were removed during the
    /// copy.
    pub restarting_jobs: u64,
    /// Artifacts that could not be copied, because their files are missing or damaged. Everything else was copied.
    pub damaged: Vec<Finding>,
}

/// Copies `data_dir` to `destination`, a folder that is empty or does not exist. The copy is checked and on disk when
/// this returns. It is complete except for the damaged artifacts, which are named.
///
/// # Errors
///
/// [`DatabaseError::NoData`], [`UpkeepError::NotEmpty`], [`UpkeepError::Inside`]; [`ArtifactError::Locked`] if another
/// process writes to the destination.
pub async fn backup(data_dir: &Path, destination: &Path) -> Result<Backup> {
    let database = data_dir.join(DATABASE);
    if !database.is_file() {
        return Err(DatabaseError::NoData { path: data_dir.to_owned() }.into());
    }
    require_outside(destination, data_dir)?;
    let _lock = lock_empty(destination)?;
    let (from, to) = (Inventory::of(data_dir), Inventory::create(destination)?);
    let _no_removal = from.prevent_removal()?;
    let copy = destination.join(DATABASE);
    let time_ms = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64;
    Inspection::snapshot(&database, &copy).await?;

    let mut inspection = Inspection::open(&copy).await?;
    let counts = inspection.counts().await?;
    let damaged = copy_artifacts(&mut inspection, &from, &to).await?;
    let restarting = copy_checkpoints(&mut inspection, &from, &to).await?;
    inspection.close().await?;
    Inspection::forget_checkpoints(&copy, &restarting).await?;

    let flushed = fail::point("backup.flush").and_then(|()| File::open(&copy)?.sync_all());
    flushed.map_err(UpkeepError::io("flush", &copy))?;
    to.flush()?;
    let manifest = Manifest {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        time_ms,
        database: digest_of_file(&copy)?,
        artifacts: counts.artifacts,
        artifact_bytes: counts.artifact_bytes,
        jobs: counts.jobs,
        damaged: damaged.iter().map(|found| found.what.clone()).collect(),
    };
    write_manifest(destination, &manifest)?;
    to.flush()?;
    Ok(Backup { manifest, restarting_jobs: restarting.len() as u64, damaged })
}

/// Copies the recorded artifacts. Returns those whose files are missing or damaged.
async fn copy_artifacts(inspection: &mut Inspection, from: &Inventory, to: &Inventory) -> Result<Vec<Finding>> {
    let (mut damaged, mut after) = (Vec::new(), String::new());
    loop {
        let page = inspection.artifacts_after(&after).await?;
        let Some(last) = page.last() else { return Ok(damaged) };
        after.clone_from(&last.digest);
        for record in page {
            match from.copy(BlobKind::Artifact, &record.digest, to) {
                Ok(_) => {}
                Err(error @ (ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. })) => {
                    let problem = blob_problem(&error);
                    damaged.push(Finding { kind: FindingKind::Artifact, what: record.digest, problem });
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
}

/// Copies the saved states of jobs. Returns the ids of the jobs whose states could not be copied.
async fn copy_checkpoints(inspection: &mut Inspection, from: &Inventory, to: &Inventory) -> Result<Vec<String>> {
    let mut restarting = Vec::new();
    for (job, digest) in inspection.checkpoints().await? {
        match from.copy(BlobKind::Checkpoint, &digest, to) {
            Ok(_) => {}
            Err(ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => restarting.push(job),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(restarting)
}

/// Refuses a destination inside the folder that is copied.
pub(super) fn require_outside(destination: &Path, folder: &Path) -> Result<()> {
    let folder = folder.canonicalize().map_err(UpkeepError::io("read the folder", folder))?;
    // The destination may not exist yet, so the nearest folder above it decides.
    let existing = std::path::absolute(destination).map_err(UpkeepError::io("find", destination))?;
    let existing = existing.ancestors().find_map(|path| path.canonicalize().ok());
    match existing.is_some_and(|path| path.starts_with(&folder)) {
        true => Err(UpkeepError::Inside { path: destination.to_owned(), folder }),
        false => Ok(()),
    }
}

/// Creates a folder, or accepts one that is empty, and locks it: no server can start on it, and no other command can
/// write to it.
pub(super) fn lock_empty(path: &Path) -> Result<FolderLock> {
    create_private_folder(path).map_err(UpkeepError::io("create the folder", path))?;
    // The first check leaves no lock file in a folder with other files. The second one finds what another process wrote
    // before this one had the lock.
    require_empty(path)?;
    let lock = FolderLock::take(path)?;
    require_empty(path)?;
    Ok(lock)
}

/// Refuses a folder with files other than the lock file, which an earlier command may have left.
fn require_empty(path: &Path) -> Result<()> {
    require_only(path, |name| name == LOCK)
}

/// Refuses a folder with files that have other names.
pub(super) fn require_only(path: &Path, is_known: impl Fn(&OsStr) -> bool) -> Result<()> {
    for entry in fs::read_dir(path).map_err(UpkeepError::io("read the folder", path))? {
        if !is_known(&entry.map_err(UpkeepError::io("read the folder", path))?.file_name()) {
            return Err(UpkeepError::NotEmpty { path: path.to_owned() });
        }
    }
    Ok(())
}

fn write_manifest(destination: &Path, manifest: &Manifest) -> Result<()> {
    let path = destination.join(MANIFEST);
    let write = || -> std::io::Result<()> {
        let mut file = private_file().write(true).create_new(true).open(&path)?;
        file.write_all(&serde_json::to_vec_pretty(manifest)?)?;
        file.write_all(b"\n")?;
        fail::point("backup.manifest")?;
        file.sync_all()
    };
    write().map_err(UpkeepError::io("write", &path))
}
