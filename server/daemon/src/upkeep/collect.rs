//! Automatic removal of jobs that ended long ago, and then of artifacts to which no record refers.
//!
//! In a data folder, removal deletes the row of an artifact first and its file second. No call can store the artifact
//! again in between (see [`Artifacts::collecting`]), so a row always has its file. A crash in between leaves a file
//! without a row. Such a file does no harm: the next upload of the same bytes replaces it, or it stays as an unreferenced file. From a bucket,
//! which other processes use, `removal` removes.

use super::removal::{Collected, STEP};
use super::{Result, removal};
use crate::config::{Config, days};
use lightpath_artifacts::Artifacts;
use lightpath_metrics as metrics;
use lightpath_store::Store;
use std::time::Duration;

/// Ages at which artifacts and jobs are removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Retention {
    /// Age since the last use, for artifacts to which no record refers; `None`: they are kept.
    pub artifacts: Option<Duration>,
    /// Age since the end of a job; `None`: jobs are kept.
    pub jobs: Option<Duration>,
}

impl Retention {
    /// The ages in the settings.
    #[must_use]
    pub fn of(config: &Config) -> Self {
        Self { artifacts: days(config.collect_artifacts_after_days), jobs: days(config.collect_jobs_after_days) }
    }

    /// Counts what a collection would remove now.
    pub async fn preview(&self, store: &Store, now_ms: i64) -> Result<Collected> {
        let mut collected = Collected::default();
        if let Some(before_ms) = before(self.jobs, now_ms) {
            collected.jobs = store.count_jobs_ended_before(before_ms).await?;
        }
        if let Some(before_ms) = before(self.artifacts, now_ms) {
            let mut after = String::new();
            loop {
                let page = store.unreferenced_artifacts(before_ms, &after, STEP).await?;
                let Some(last) = page.last() else { break };
                after.clone_from(&last.digest);
                collected.artifacts += page.len() as u64;
                collected.artifact_bytes += page.iter().map(|record| record.size_bytes).sum::<u64>();
            }
        }
        Ok(collected)
    }

    /// Removes the jobs and artifacts that have reached their age.
    ///
    /// # Errors
    ///
    /// What was removed before the error stays removed.
    pub async fn collect(&self, store: &Store, artifacts: &Artifacts, now_ms: i64) -> Result<Collected> {
        let mut collected = Collected::default();
        if let Some(before_ms) = before(self.jobs, now_ms) {
            loop {
                let ids = store.jobs_ended_before(before_ms, STEP).await?;
                if ids.is_empty() {
                    break;
                }
                let deleted = store.delete_jobs(ids, before_ms, now_ms).await?;
                for digest in &deleted.checkpoints {
                    artifacts.delete_checkpoint(digest).await?;
                }
                collected.jobs += deleted.jobs;
            }
        }
        if let Some(before_ms) = before(self.artifacts, now_ms) {
            // These states may refer to artifacts, which would otherwise have to be kept.
            for digest in store.forget_old_checkpoints(before_ms).await? {
                artifacts.delete_checkpoint(&digest).await?;
            }
            let removed = match artifacts.is_shared() {
                true => removal::unreferenced_artifacts(store, artifacts, before_ms).await?,
                false => from_folder(store, artifacts, before_ms).await?,
            };
            collected.artifacts = removed.artifacts;
            collected.artifact_bytes = removed.artifact_bytes;
        }
        if artifacts.is_shared() {
            removal::unrecorded_artifacts(store, artifacts, now_ms).await?;
            removal::unreferenced_checkpoints(store, artifacts, now_ms).await?;
        }
        metrics::collected(collected.jobs, collected.artifacts, collected.artifact_bytes);
        Ok(collected)
    }
}

/// Removes the artifacts in the data folder, which no other process uses.
async fn from_folder(store: &Store, artifacts: &Artifacts, before_ms: i64) -> Result<Collected> {
    let (mut collected, mut after) = (Collected::default(), String::new());
    loop {
        let page = store.unreferenced_artifacts(before_ms, &after, STEP).await?;
        let Some(last) = page.last() else { return Ok(collected) };
        after.clone_from(&last.digest);
        // A backup copies the folder, or the process of a job stores a result; the next collection removes the rest.
        let Some(_removal) = artifacts.collecting().await? else { return Ok(collected) };
        for record in page {
            if store.forget_artifact(&record.digest, before_ms).await? {
                artifacts.delete(&record.digest).await?;
                collected.artifacts += 1;
                collected.artifact_bytes += record.size_bytes;
            }
        }
    }
}

/// Time before which an item must have ended or been used last to be removed \[ms since 1970\].
fn before(age: Option<Duration>, now_ms: i64) -> Option<i64> {
    age.map(|age| now_ms.saturating_sub(i64::try_from(age.as_millis()).unwrap_or(i64::MAX)))
}
