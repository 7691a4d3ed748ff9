//! What goes by itself: artifacts that nothing refers to, and jobs that ended long ago.

use super::artifacts::record_of;
use super::write::Write;
use super::{ArtifactRecord, Store, StoreError, page};
use sqlx::Row;

/// An artifact that nobody refers to, last used before `?1`. A job that can still go on may have put into its saved state
/// what it names only when it ends: whatever is younger than such a job stays.
macro_rules! unreferenced {
    ($head:literal, $tail:literal) => {
        concat!(
            $head,
            " where use_time_ms < ?1 \
             and use_time_ms < coalesce((select min(create_time_ms) from job where checkpoint is not null), ?1) \
             and not exists (select 1 from job_artifact where artifact = artifact.digest) \
             and not exists (select 1 from pair where phase = artifact.digest) \
             and not exists (select 1 from pair where photo = artifact.digest) \
             and not exists (select 1 from dataset where instr(alignment, artifact.digest) > 0) \
             and not exists (select 1 from kernel_version where artifact = artifact.digest) ",
            $tail
        )
    };
}

impl Store {
    /// At most `limit` artifacts that nothing refers to and that nobody used since `before_ms`, behind `after`.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn unreferenced_artifacts(
        &self,
        before_ms: i64,
        after: &str,
        limit: u32,
    ) -> Result<Vec<ArtifactRecord>, StoreError> {
        let sql = unreferenced!("select * from artifact", "and digest > ?2 order by digest limit ?3");
        let query = sqlx::query(sql).bind(before_ms).bind(after).bind(page(limit));
        query.fetch_all(self.readers()).await?.iter().map(record_of).collect()
    }

    /// Forgets an artifact, where still nothing refers to it; whether it did. Its file goes next.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], [`StoreError::DiskFull`].
    pub async fn forget_artifact(&self, digest: &str, before_ms: i64) -> Result<bool, StoreError> {
        let digest = digest.to_owned();
        self.write(move |write| {
            Box::pin(async move {
                let sql = unreferenced!("delete from artifact", "and digest = ?2");
                let deleted = sqlx::query(sql).bind(before_ms).bind(digest).execute(write.sql()).await?;
                Ok(deleted.rows_affected() == 1)
            })
        })
        .await
    }

    /// Forgets the saved states of jobs that failed before `before_ms`: queued again by hand, they start over. Digests of
    /// the states, whose files go next.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], [`StoreError::DiskFull`].
    pub async fn forget_old_checkpoints(&self, before_ms: i64) -> Result<Vec<String>, StoreError> {
        self.write(move |write| {
            Box::pin(async move {
                let sql = "select checkpoint from job \
                           where checkpoint is not null and state = 'failed' and finish_time_ms < ?";
                let digests = sqlx::query_scalar(sql).bind(before_ms).fetch_all(write.sql()).await?;
                let sql = "update job set checkpoint = null, revision = revision + 1 \
                           where checkpoint is not null and state = 'failed' and finish_time_ms < ?";
                sqlx::query(sql).bind(before_ms).execute(write.sql()).await?;
                Ok(digests)
            })
        })
        .await
    }

    /// At most `limit` jobs that ended before `before_ms`, the oldest first.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn jobs_ended_before(&self, before_ms: i64, limit: u32) -> Result<Vec<String>, StoreError> {
        let sql = "select id from job where finish_time_ms < ? order by finish_time_ms limit ?";
        Ok(sqlx::query_scalar(sql).bind(before_ms).bind(page(limit)).fetch_all(self.readers()).await?)
    }

    /// How many jobs ended before `before_ms`.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn count_jobs_ended_before(&self, before_ms: i64) -> Result<u64, StoreError> {
        let sql = "select count(*) from job where finish_time_ms < ?";
        let count: i64 = sqlx::query_scalar(sql).bind(before_ms).fetch_one(self.readers()).await?;
        Ok(count.unsigned_abs())
    }

    /// Deletes those of the jobs that ended before `before_ms`, with their events; digests of their checkpoints, whose
    /// files go next. What they made stays as long as anything refers to it, and its time of grace after that.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], [`StoreError::DiskFull`].
    pub async fn delete_jobs(&self, ids: Vec<String>, before_ms: i64, now_ms: i64) -> Result<Deleted, StoreError> {
        self.write(move |write| Box::pin(delete_jobs(write, ids, before_ms, now_ms))).await
    }
}

/// Jobs that are gone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Deleted {
    /// How many.
    pub jobs: u64,
    /// Of failed jobs that could have gone on.
    pub checkpoints: Vec<String>,
}

async fn delete_jobs(write: &mut Write, ids: Vec<String>, before_ms: i64, now_ms: i64) -> Result<Deleted, StoreError> {
    let mut deleted = Deleted::default();
    for id in ids {
        // Queued again by hand meanwhile, it stays.
        let sql = "select checkpoint from job where id = ? and finish_time_ms < ?";
        let row = sqlx::query(sql).bind(&id).bind(before_ms).fetch_optional(write.sql()).await?;
        let Some(row) = row else { continue };
        deleted.checkpoints.extend(row.try_get::<Option<String>, _>("checkpoint")?);
        for sql in [
            // Somebody may be downloading, or be about to use, what the job made.
            "update artifact set use_time_ms = max(use_time_ms, ?2) \
             where digest in (select artifact from job_artifact where job = ?1)",
            "delete from job_artifact where job = ?1",
            "delete from job_dependency where job = ?1 or after = ?1",
            "delete from job_event where job = ?1",
            "delete from job where id = ?1",
        ] {
            sqlx::query(sql).bind(&id).bind(now_ms).execute(write.sql()).await?;
        }
        deleted.jobs += 1;
    }
    Ok(deleted)
}
