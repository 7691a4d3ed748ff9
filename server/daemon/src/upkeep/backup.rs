//! A consistent copy of a data folder that a server may be using.
//!
//! The database is copied as of one moment (`vacuum into`), then every blob that this copy refers to. Blobs never
//! change, and the server removes no artifact during the copy, so no artifact of the copy can be missing. Checkpoints
//! can be removed during the copy: a job whose saved state is missing starts from the beginning after a restore, with
//! the same result.

use super::{DATABASE, UpkeepError};
use lightpath_artifacts::{ArtifactError, BlobKind, Inventory, digest_of_file};
use lightpath_fail_points as fail;
use lightpath_store::Inspection;
use serde::{Deserialize, Serialize};
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
    /// Number of recorded artifacts.
    pub artifacts: u64,
    /// Size of all recorded artifacts \[bytes\].
    pub artifact_bytes: u64,
    /// Number of jobs in all states.
    pub jobs: u64,
}

/// Result of a backup.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Backup {
    /// The manifest as it was written.
    pub manifest: Manifest,
    /// Number of jobs that start from the beginning after a restore, because their saved states were removed during the
    /// copy.
    pub restarting_jobs: u64,
}

/// Copies `data_dir` to `destination`, a folder that is empty or does not exist. The copy is complete, checked and on
/// disk when this returns.
///
/// # Errors
///
/// [`UpkeepError::NoData`], [`UpkeepError::NotEmpty`]; [`UpkeepError::Damaged`] if an artifact is missing or does not
/// match its digest.
pub async fn backup(data_dir: &Path, destination: &Path) -> Result<Backup, UpkeepError> {
    let database = data_dir.join(DATABASE);
    if !database.is_file() {
        return Err(UpkeepError::NoData { path: data_dir.to_owned() });
    }
    make_empty(destination)?;
    let (from, to) = (Inventory::of(data_dir), Inventory::create(destination)?);
    let _no_removal = from.prevent_removal()?;
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

/// Copies the saved states of jobs. Returns the ids of the jobs whose states could not be copied.
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

/// Creates a folder, or accepts one that is empty.
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
