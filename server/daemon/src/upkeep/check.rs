//! Is everything there that the database promises?

use super::{DATABASE, UpkeepError};
use lightpath_artifacts::{ArtifactError, BlobKind, Inventory};
use lightpath_store::{Counts, Inspection};
use serde::Serialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// What a check found.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The folder.
    pub data_dir: PathBuf,
    /// The last migration that the database has been through.
    pub schema: String,
    /// Jobs in all states.
    pub jobs: u64,
    /// Versions of all kernels.
    pub kernel_versions: u64,
    /// Recorded artifacts, each read and compared with its digest.
    pub artifacts: u64,
    /// Their bytes.
    pub artifact_bytes: u64,
    /// Saved states that jobs would go on from, each read and compared with its digest.
    pub checkpoints: u64,
    /// What is wrong. Empty: nothing is.
    pub problems: Vec<Finding>,
    /// Files that nothing refers to: no harm, they go by themselves.
    pub unreferenced_files: u64,
}

/// Something wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// In which part.
    pub kind: FindingKind,
    /// What it is about, for example a digest.
    pub what: String,
    /// What is wrong with it.
    pub problem: String,
}

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The database: pages, indexes, constraints, references between rows.
    Database,
    /// A job whose history contradicts its state.
    Job,
    /// A recorded artifact whose file is gone or has other bytes.
    Artifact,
    /// A row that names an artifact that is not recorded.
    Reference,
    /// A saved state that is gone or has other bytes; the job would start over.
    Checkpoint,
}

impl FindingKind {
    /// In lower case, as people read it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Database => "database",
            Self::Job => "job",
            Self::Artifact => "artifact",
            Self::Reference => "reference",
            Self::Checkpoint => "checkpoint",
        }
    }
}

/// Reads the whole data folder and compares it with what the database says. Works beside a server that runs.
///
/// # Errors
///
/// [`UpkeepError::NoData`], and where the folder cannot be read at all; what is wrong inside is in the report.
pub async fn check(data_dir: &Path) -> Result<Report, UpkeepError> {
    let database = data_dir.join(DATABASE);
    if !database.is_file() {
        return Err(UpkeepError::NoData { path: data_dir.to_owned() });
    }
    let mut inspection = Inspection::open(&database).await?;
    let schema = inspection.steps().await?.last().copied().unwrap_or("none").to_owned();
    let Counts { jobs, kernel_versions, .. } = inspection.counts().await?;
    let mut problems = database_problems(&mut inspection).await?;
    let inventory = Inventory::of(data_dir);
    let mut files = files(&inventory)?;
    let (artifacts, artifact_bytes) = check_artifacts(&mut inspection, &inventory, &mut files, &mut problems).await?;
    let checkpoints = check_checkpoints(&mut inspection, &inventory, &mut files, &mut problems).await?;
    inspection.close().await?;
    let unreferenced_files = (files.len() + inventory.temporary_files()?) as u64;
    Ok(Report {
        data_dir: data_dir.to_owned(),
        schema,
        jobs,
        kernel_versions,
        artifacts,
        artifact_bytes,
        checkpoints,
        problems,
        unreferenced_files,
    })
}

async fn database_problems(inspection: &mut Inspection) -> Result<Vec<Finding>, UpkeepError> {
    let mut problems = Vec::new();
    for problem in inspection.damages().await? {
        problems.push(Finding { kind: FindingKind::Database, what: DATABASE.to_owned(), problem });
    }
    for problem in inspection.contradictions().await? {
        problems.push(Finding { kind: FindingKind::Job, what: DATABASE.to_owned(), problem });
    }
    for dangling in inspection.dangling_references().await? {
        let problem = format!("names {}, which is not recorded", dangling.digest);
        problems.push(Finding { kind: FindingKind::Reference, what: dangling.by, problem });
    }
    Ok(problems)
}

/// Every file that is there before the rows are read; what stays in the set is referred to by none.
fn files(inventory: &Inventory) -> Result<HashSet<(bool, String)>, UpkeepError> {
    let mut files = HashSet::new();
    for kind in [BlobKind::Artifact, BlobKind::Checkpoint] {
        match inventory.list(kind) {
            Ok(digests) => files.extend(digests.into_iter().map(|digest| (kind == BlobKind::Artifact, digest))),
            // Without the folder every recorded file is missing, and is told so one by one.
            Err(ArtifactError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(files)
}

async fn check_artifacts(
    inspection: &mut Inspection,
    inventory: &Inventory,
    files: &mut HashSet<(bool, String)>,
    problems: &mut Vec<Finding>,
) -> Result<(u64, u64), UpkeepError> {
    let (mut count, mut bytes, mut after) = (0, 0, String::new());
    loop {
        let page = inspection.artifacts_after(&after).await?;
        let Some(last) = page.last() else { return Ok((count, bytes)) };
        after.clone_from(&last.digest);
        for record in page {
            files.remove(&(true, record.digest.clone()));
            let problem = match inventory.verify(BlobKind::Artifact, &record.digest) {
                Ok(size_bytes) if size_bytes == record.size_bytes => None,
                Ok(size_bytes) => Some(format!("has {size_bytes} bytes, but {} are recorded", record.size_bytes)),
                // A server may have collected it meanwhile.
                Err(_) if !inspection.has_artifact(&record.digest).await? => continue,
                Err(error) => Some(blob_problem(&error)),
            };
            count += 1;
            bytes += record.size_bytes;
            if let Some(problem) = problem {
                problems.push(Finding { kind: FindingKind::Artifact, what: record.digest, problem });
            }
        }
    }
}

async fn check_checkpoints(
    inspection: &mut Inspection,
    inventory: &Inventory,
    files: &mut HashSet<(bool, String)>,
    problems: &mut Vec<Finding>,
) -> Result<u64, UpkeepError> {
    let mut count = 0;
    for (job, mut digest) in inspection.checkpoints().await? {
        loop {
            files.remove(&(false, digest.clone()));
            let Err(error) = inventory.verify(BlobKind::Checkpoint, &digest) else { break };
            // A job that runs replaces its checkpoint all the time, or has ended meanwhile.
            match inspection.checkpoint_of(&job).await? {
                None => break,
                Some(newer) if newer != digest => digest = newer,
                Some(_) => {
                    let problem = format!("{digest} {}", blob_problem(&error));
                    problems.push(Finding { kind: FindingKind::Checkpoint, what: format!("jobs/{job}"), problem });
                    break;
                }
            }
        }
        count += 1;
    }
    Ok(count)
}

/// What is wrong with a blob, to go on from its name.
fn blob_problem(error: &ArtifactError) -> String {
    match error {
        ArtifactError::NotFound { .. } => "is not on disk".to_owned(),
        ArtifactError::DataLoss { .. } => "has bytes that do not match its digest".to_owned(),
        other => format!("cannot be read: {}", lightpath_domain::causes::with_causes(other)),
    }
}
