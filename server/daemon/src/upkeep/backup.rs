//! A consistent copy of a data folder, while the server works in it.
//!
//! The database is copied as it is at one moment (`vacuum into`), then every blob that the copy names. Blobs never
//! change, and while the copy is made the server removes none, so that nothing that the copy names can be missing.
//! Checkpoints do go: a job whose saved state went meanwhile starts over after a restore, and gives the same bytes.

use super::{DATABASE, UpkeepError};
use lightpath_artifacts::{ArtifactError, BlobKind, Inventory, digest_of_file};
use lightpath_fail_points as fail;
use lightpath_store::Inspection;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Written last: a folder with it is a complete backup.
pub(super) const MANIFEST: &str = "backup.json";

/// What a complete backup says of itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The program's version.
    pub version: String,
    /// When the database was copied \[ms since 1970\].
    pub time_ms: u64,
    /// `sha256-…` of the database.
    pub database: String,
    /// Recorded artifacts.
    pub artifacts: u64,
    /// Their bytes.
    pub artifact_bytes: u64,
    /// Jobs in all states.
    pub jobs: u64,
}

/// What a backup did.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Backup {
    /// As written.
    pub manifest: Manifest,
    /// Jobs that start over after a restore, since their saved state went while it was copied.
    pub restarting_jobs: u64,
}

/// Copies `data_dir` to `destination`, a folder that is empty or does not exist. When this returns the copy is
/// complete, checked and on disk.
///
/// # Errors
///
/// [`UpkeepError::NoData`], [`UpkeepError::NotEmpty`]; [`UpkeepError::Damaged`] where an artifact is missing or has
/// other bytes than it should.
pub async fn backup(data_dir: &Path, destination: &Path) -> Result<Backup, UpkeepError> {
    let database = data_dir.join(DATABASE);
    if !database.is_file() {
        return Err(UpkeepError::NoData { path: data_dir.to_owned() });
    }
    make_empty(destination)?;
    let (from, to) = (Inventory::of(data_dir), Inventory::create(destination)?);
    let _keep = from.keep()?;
    let copy = destination.join(DATABASE);
    let time_ms = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64;
    Inspection::snapshot(&database, &copy).await?;

    let mut inspection = Inspection::open(&copy).await?;
    let counts = inspection.counts().await?;
    let damaged = |source| UpkeepError::Damaged { path: data_dir.to_owned(), source };
    let mut after = String::new();
    loop {
        let page = inspection.artifacts_after(&after).await?;
        let Some(last) = page.last() else { break };
        after.clone_from(&last.digest);
        for record in page {
            from.copy(BlobKind::Artifact, &record.digest, &to).map_err(|error| match error {
                error @ (ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => damaged(error),
                other => other.into(),
            })?;
        }
    }
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
    };
    write_manifest(destination, &manifest)?;
    to.flush()?;
    Ok(Backup { manifest, restarting_jobs: restarting.len() as u64 })
}

/// Copies what jobs would go on from; ids of the jobs whose state could not be had.
async fn copy_checkpoints(
    inspection: &mut Inspection,
    from: &Inventory,
    to: &Inventory,
) -> Result<Vec<String>, UpkeepError> {
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

/// Makes a folder, or takes one that is empty.
pub(super) fn make_empty(path: &Path) -> Result<(), UpkeepError> {
    fs::create_dir_all(path).map_err(UpkeepError::io("create the folder", path))?;
    let mut entries = fs::read_dir(path).map_err(UpkeepError::io("read the folder", path))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(UpkeepError::NotEmpty { path: path.to_owned() }),
    }
}

fn write_manifest(destination: &Path, manifest: &Manifest) -> Result<(), UpkeepError> {
    let path = destination.join(MANIFEST);
    let write = || -> std::io::Result<()> {
        let mut file = File::create_new(&path)?;
        file.write_all(&serde_json::to_vec_pretty(manifest)?)?;
        file.write_all(b"\n")?;
        fail::point("backup.manifest")?;
        file.sync_all()
    };
    write().map_err(UpkeepError::io("write", &path))
}
