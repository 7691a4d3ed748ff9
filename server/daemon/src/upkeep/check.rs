//! Checks that a data folder contains everything to which its database refers.

use super::Result;
use super::blob_reader::BlobReader;
use crate::database::Database;
use futures::{StreamExt as _, stream};
use lightpath_artifacts::{BlobKind, RemoteOptions};
use lightpath_store::{Counts, Inspection, StoredBlob};
use serde::Serialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Number of artifacts that are read at the same time.
const AT_ONCE: usize = 8;

/// Result of a check.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Path of the data folder.
    pub data_dir: PathBuf,
    /// URL of the bucket that has the artifacts; `None`: they are in the data folder.
    pub bucket: Option<String>,
    /// Name of the last migration that was applied to the database.
    pub schema: String,
    /// Number of jobs in all states.
    pub jobs: u64,
    /// Number of versions of all kernels.
    pub kernel_versions: u64,
    /// Number of recorded artifacts. Each was read and compared with its digest.
    pub artifacts: u64,
    /// Size of all recorded artifacts \[bytes\].
    pub artifact_bytes: u64,
    /// Number of saved states of jobs. Each was read and compared with its digest.
    pub checkpoints: u64,
    /// Problems found. Empty: the folder is sound.
    pub problems: Vec<Finding>,
    /// Number of files, or of blobs in the bucket, to which no record refers. They do no harm.
    pub unreferenced_files: u64,
}

/// A problem in a data folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Kind of the problem.
    pub kind: FindingKind,
    /// The damaged item, for example a digest.
    pub what: String,
    /// Description of the problem.
    pub problem: String,
}

/// Kind of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Damage in the database: pages, indexes, constraints, references between rows.
    Database,
    /// A job whose events contradict its state.
    Job,
    /// A finalized dataset whose digest does not match its content.
    Dataset,
    /// A recorded artifact that is missing or damaged.
    Artifact,
    /// A row that refers to an artifact that is not recorded.
    Reference,
    /// A saved state that is missing or damaged. Its job would start from the beginning.
    Checkpoint,
}

impl FindingKind {
    /// Name of the kind in lower case, for people.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Database => "database",
            Self::Job => "job",
            Self::Dataset => "dataset",
            Self::Artifact => "artifact",
            Self::Reference => "reference",
            Self::Checkpoint => "checkpoint",
        }
    }
}

/// Reads the whole data folder and compares it with the database. A server may be running during the check.
///
/// # Errors
///
/// [`DatabaseError::NoData`](crate::database::DatabaseError::NoData), or another error if the folder cannot be read at all. Problems inside are in the report.
pub async fn check(data_dir: &Path) -> Result<Report> {
    check_with(data_dir, &Database::InFolder(data_dir.to_owned()), None).await
}

/// Does the same as [`check`] for a data folder whose `database` and artifacts may be elsewhere. With a bucket, the copies
/// in the data folder are not read: each blob is read from the bucket.
///
/// # Errors
///
/// The errors of [`check`]; [`DatabaseError::OtherArtifacts`](crate::database::DatabaseError::OtherArtifacts) if the database belongs to other artifacts;
/// [`ArtifactError::Remote`](lightpath_artifacts::ArtifactError::Remote) if the bucket cannot be reached.
pub async fn check_with(data_dir: &Path, database: &Database, bucket: Option<&RemoteOptions>) -> Result<Report> {
    let mut inspection = database.inspect().await?;
    let reader = BlobReader::open(data_dir, bucket).await?;
    reader.require(&mut inspection).await?;
    let schema = inspection.steps().await?.pop().unwrap_or_else(|| "none".to_owned());
    let Counts { jobs, kernel_versions, .. } = inspection.counts().await?;
    let mut problems = database_problems(&mut inspection, database.name()).await?;
    let mut blobs = reader.blobs().await?;
    let (artifacts, artifact_bytes) = check_artifacts(&mut inspection, &reader, &mut blobs, &mut problems).await?;
    let checkpoints = check_checkpoints(&mut inspection, &reader, &mut blobs, &mut problems).await?;
    inspection.close().await?;
    let unreferenced_files = (blobs.len() + reader.temporary_files()?) as u64;
    Ok(Report {
        data_dir: data_dir.to_owned(),
        bucket: bucket.map(|options| options.url.clone()),
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

async fn database_problems(inspection: &mut Inspection, name: &str) -> Result<Vec<Finding>> {
    let mut problems = Vec::new();
    for problem in inspection.damages().await? {
        problems.push(Finding { kind: FindingKind::Database, what: name.to_owned(), problem });
    }
    for problem in inspection.contradictions().await? {
        problems.push(Finding { kind: FindingKind::Job, what: name.to_owned(), problem });
    }
    for id in inspection.changed_datasets().await? {
        let problem = "has a digest that does not match its pairs, split and alignment".to_owned();
        problems.push(Finding { kind: FindingKind::Dataset, what: format!("datasets/{id}"), problem });
    }
    for dangling in inspection.dangling_references().await? {
        let problem = format!("refers to {}, which is not recorded", dangling.digest);
        problems.push(Finding { kind: FindingKind::Reference, what: dangling.row, problem });
    }
    Ok(problems)
}

async fn check_artifacts(
    inspection: &mut Inspection,
    reader: &BlobReader,
    blobs: &mut HashSet<(bool, String)>,
    problems: &mut Vec<Finding>,
) -> Result<(u64, u64)> {
    let (mut count, mut bytes, mut after) = (0, 0, String::new());
    loop {
        let page = inspection.artifacts_after(&after).await?;
        let Some(last) = page.last() else { return Ok((count, bytes)) };
        after.clone_from(&last.digest);
        let verify = async |record: StoredBlob| (reader.verify(BlobKind::Artifact, &record.digest).await, record);
        let verified: Vec<_> = stream::iter(page).map(verify).buffered(AT_ONCE).collect().await;
        for (found, record) in verified {
            blobs.remove(&(true, record.digest.clone()));
            let problem = match found {
                Ok(size_bytes) if size_bytes == record.size_bytes => None,
                Ok(size_bytes) => Some(format!("has {size_bytes} bytes, but {} are recorded", record.size_bytes)),
                // A server may have removed the artifact in the meantime.
                Err(_) if !inspection.has_artifact(&record.digest).await? => continue,
                Err(error) => Some(reader.problem(&error)),
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
    reader: &BlobReader,
    blobs: &mut HashSet<(bool, String)>,
    problems: &mut Vec<Finding>,
) -> Result<u64> {
    let mut count = 0;
    for (job, mut digest) in inspection.checkpoints().await? {
        loop {
            blobs.remove(&(false, digest.clone()));
            let Err(error) = reader.verify(BlobKind::Checkpoint, &digest).await else { break };
            // A running job replaces its checkpoint often, and an ended job has none.
            match inspection.checkpoint_of(&job).await? {
                None => break,
                Some(newer) if newer != digest => digest = newer,
                Some(_) => {
                    let problem = format!("{digest} {}", reader.problem(&error));
                    problems.push(Finding { kind: FindingKind::Checkpoint, what: format!("jobs/{job}"), problem });
                    break;
                }
            }
        }
        count += 1;
    }
    Ok(count)
}
