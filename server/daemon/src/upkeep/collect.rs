//! What goes by itself: jobs that ended long ago, then artifacts that nothing refers to any more.
//!
//! An artifact goes row first, file second. In between nobody can store it again (see [`Artifacts::collecting`]), so a
//! row never lacks its file; a file without a row, after a crash in between, has no harm in it and is removed by the
//! next upload of the same bytes or stays as an unreferenced file.

use super::UpkeepError;
use lightpath_artifacts::Artifacts;
use lightpath_metrics as metrics;
use lightpath_store::Store;
use serde::Serialize;
use std::time::Duration;

/// Rows in one step, between which others get their turn.
const STEP: u32 = 100;

/// When something may go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Retention {
    /// Since the last use of an artifact that nothing refers to; `None`: it stays.
    pub artifacts: Option<Duration>,
    /// Since the end of a job; `None`: it stays.
    pub jobs: Option<Duration>,
}

/// What went, or would go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Collected {
    /// Jobs, with their events.
    pub jobs: u64,
    /// Artifacts. What only those jobs referred to goes later: its time begins with their end.
    pub artifacts: u64,
    /// Bytes of these artifacts.
    pub artifact_bytes: u64,
}

impl Retention {
    /// What would go now.
    ///
    /// # Errors
    ///
    /// [`UpkeepError::Store`].
    pub async fn preview(&self, store: &Store, now_ms: i64) -> Result<Collected, UpkeepError> {
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
                collected.artifact_bytes += page.iter().map(|it| it.size_bytes).sum::<u64>();
            }
        }
        Ok(collected)
    }

    /// Removes what may go.
    ///
    /// # Errors
    ///
    /// [`UpkeepError::Store`], [`UpkeepError::Artifacts`]; what went before the error has gone.
    pub async fn collect(&self, store: &Store, artifacts: &Artifacts, now_ms: i64) -> Result<Collected, UpkeepError> {
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
            // They may name artifacts that would have to stay for them.
            for digest in store.forget_old_checkpoints(before_ms).await? {
                artifacts.delete_checkpoint(&digest).await?;
            }
            let mut after = String::new();
            loop {
                let page = store.unreferenced_artifacts(before_ms, &after, STEP).await?;
                let Some(last) = page.last() else { break };
                after.clone_from(&last.digest);
                // Whoever copies the folder comes first; the next collection takes the rest.
                let Some(_alone) = artifacts.collecting().await? else { break };
                for record in page {
                    if store.forget_artifact(&record.digest, before_ms).await? {
                        artifacts.delete(&record.digest).await?;
                        collected.artifacts += 1;
                        collected.artifact_bytes += record.size_bytes;
                    }
                }
            }
        }
        metrics::collected(collected.jobs, collected.artifacts, collected.artifact_bytes);
        Ok(collected)
    }
}

/// What ended before this may go \[ms since 1970\].
fn before(age: Option<Duration>, now_ms: i64) -> Option<i64> {
    age.map(|age| now_ms.saturating_sub(i64::try_from(age.as_millis()).unwrap_or(i64::MAX)))
}
