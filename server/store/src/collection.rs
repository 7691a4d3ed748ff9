//! Automatic removal of artifacts that no record refers to and of jobs that ended long ago.

use super::artifacts::record_of;
use super::rows::to_json;
use super::sql::{query, scalar};
use super::write::Write;
use super::{ArtifactRecord, Result, Store, page};
use uuid::Uuid;

/// Selects the artifacts last used before `$1` that no record refers to. The saved state of a job may name artifacts
/// that the job will refer to only at its end. Therefore artifacts used since the creation of the oldest job with a
/// saved state are kept.
macro_rules! unreferenced {
    ($head:literal, $tail:literal) => {
        concat!(
            $head,
            " where use_time_ms < $1 \
             and use_time_ms < coalesce((select min(create_time_ms) from job where checkpoint is not null), $1) \
             and not exists (select 1 from job_artifact where artifact = artifact.digest) \
             and not exists (select 1 from pair where pattern = artifact.digest) \
             and not exists (select 1 from pair where photo = artifact.digest) \
             and not exists (select 1 from dataset where instr(alignment, artifact.digest) > 0) \
             and not exists (select 1 from kernel_version where artifact = artifact.digest) ",
            $tail
        )
    };
}

impl Store {
    /// At most `limit` artifacts, in the order of their digests and behind `after`, that no record refers to and that
    /// were last used before `before_ms`.
    pub async fn unreferenced_artifacts(&self, before_ms: i64, after: &str, limit: u32) -> Result<Vec<ArtifactRecord>> {
        let sql = unreferenced!("select * from artifact", "and digest > $2 order by digest limit $3");
        let query = query(sql).bind((before_ms, after, page(limit)));
        query.fetch_all(self.readers()).await?.iter().map(record_of).collect()
    }

    /// Deletes the record of an artifact if still no record refers to it. Returns whether it was deleted; then the
    /// caller removes the file.
    pub async fn forget_artifact(&self, digest: &str, before_ms: i64) -> Result<bool> {
        let digest = digest.to_owned();
        self.write(async move |write| {
            let sql = unreferenced!("delete from artifact", "and digest = $2");
            let deleted = query(sql).bind((before_ms, digest)).execute(write.sql()).await?;
            Ok(deleted == 1)
        })
        .await
    }

    /// Does the same as [`Self::forget_artifact`] for an artifact in a bucket, whose objects the caller has listed and
    /// removes next. Returns the mark of the removal; `None` if the artifact is kept.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::forget_artifact`].
    pub async fn begin_removal(&self, digest: &str, before_ms: i64) -> Result<Option<String>> {
        let digest = digest.to_owned();
        self.write(async move |write| {
            let sql = unreferenced!("delete from artifact", "and digest = $2");
            if query(sql).bind((before_ms, &digest)).execute(write.sql()).await? == 0 {
                return Ok(None);
            }
            let mark = Uuid::now_v7().to_string();
            let sql = "insert into artifact_removal values ($1, $2)";
            query(sql).bind((digest, &mark)).execute(write.sql()).await?;
            Ok(Some(mark))
        })
        .await
    }

    /// Does the same as [`Self::begin_removal`] for a blob that no row records, because the process died that stored it.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::forget_artifact`].
    pub async fn begin_removal_of_unrecorded(&self, digest: &str) -> Result<Option<String>> {
        let (digest, mark) = (digest.to_owned(), Uuid::now_v7().to_string());
        self.write(async move |write| {
            let sql = "insert into artifact_removal select $1, $2 \
                       where not exists (select 1 from artifact where digest = $1) on conflict do nothing";
            let inserted = query(sql).bind((digest, &mark)).execute(write.sql()).await?;
            Ok((inserted == 1).then_some(mark))
        })
        .await
    }

    /// Those of `digests` that are neither recorded nor being removed, in no particular order.
    pub async fn unrecorded(&self, digests: &[String]) -> Result<Vec<String>> {
        let sql = "select value from json_each($1) as given where not exists (select 1 from artifact where digest = given.value) \
                   and not exists (select 1 from artifact_removal where digest = given.value)";
        Ok(scalar(sql).bind(to_json("digests", &digests)?).fetch_all(self.readers()).await?)
    }

    /// Takes over a removal that another collector began, and may still be about. Returns its new mark; `None` if the
    /// removal no longer has the mark that the caller has `seen` before it listed the objects.
    pub async fn continue_removal(&self, digest: &str, seen: &str) -> Result<Option<String>> {
        let (digest, seen, mark) = (digest.to_owned(), seen.to_owned(), Uuid::now_v7().to_string());
        self.write(async move |write| {
            let sql = "update artifact_removal set mark = $3 where digest = $1 and mark = $2";
            let changed = query(sql).bind((digest, seen, &mark)).execute(write.sql()).await?;
            Ok((changed == 1).then_some(mark))
        })
        .await
    }

    /// Ends a removal whose objects are removed, if it still has this mark. Returns whether it had.
    pub async fn end_removal(&self, digest: &str, mark: &str) -> Result<bool> {
        let (digest, mark) = (digest.to_owned(), mark.to_owned());
        self.write(async move |write| {
            let sql = "delete from artifact_removal where digest = $1 and mark = $2";
            Ok(query(sql).bind((digest, mark)).execute(write.sql()).await? == 1)
        })
        .await
    }

    /// Digests and marks of at most `limit` removals, in the order of their digests and behind `after`.
    pub async fn removals(&self, after: &str, limit: u32) -> Result<Vec<(String, String)>> {
        let sql = "select digest, mark from artifact_removal where digest > $1 order by digest limit $2";
        let rows = query(sql).bind((after, page(limit))).fetch_all(self.readers()).await?;
        rows.iter().map(|row| Ok((row.try_get("digest")?, row.try_get("mark")?))).collect()
    }

    /// Forgets the saved states of jobs that failed before `before_ms`: such a job starts from the beginning if it is
    /// retried. Returns the digests of the states, whose files the caller removes.
    pub async fn forget_old_checkpoints(&self, before_ms: i64) -> Result<Vec<String>> {
        self.write(async move |write| {
            let sql = "select checkpoint from job \
                       where checkpoint is not null and state = 'failed' and finish_time_ms < $1";
            let digests = scalar(sql).bind(before_ms).fetch_all(write.sql()).await?;
            let sql = "update job set checkpoint = null, revision = revision + 1 \
                       where checkpoint is not null and state = 'failed' and finish_time_ms < $1";
            query(sql).bind(before_ms).execute(write.sql()).await?;
            Ok(digests)
        })
        .await
    }

    /// Ids of at most `limit` jobs that ended before `before_ms`, the oldest first.
    pub async fn jobs_ended_before(&self, before_ms: i64, limit: u32) -> Result<Vec<String>> {
        let sql = "select id from job where finish_time_ms < $1 order by finish_time_ms limit $2";
        Ok(scalar(sql).bind((before_ms, page(limit))).fetch_all(self.readers()).await?)
    }

    /// Number of jobs that ended before `before_ms`.
    pub async fn count_jobs_ended_before(&self, before_ms: i64) -> Result<u64> {
        let sql = "select count(*) from job where finish_time_ms < $1";
        Ok(scalar(sql).bind(before_ms).fetch_one(self.readers()).await?)
    }

    /// Deletes the jobs among `ids` that ended before `before_ms`, with their events. Returns the digests of their
    /// checkpoints, whose files the caller removes. The artifacts that the jobs made stay while another record refers
    /// to them, and for the time of grace after that.
    pub async fn delete_jobs(&self, ids: Vec<String>, before_ms: i64, now_ms: i64) -> Result<Deleted> {
        self.write(async move |write| delete_jobs(write, ids, before_ms, now_ms).await).await
    }
}

/// Result of deleting jobs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Deleted {
    /// Number of deleted jobs.
    pub jobs: u64,
    /// Digests of the saved states of the deleted jobs.
    pub checkpoints: Vec<String>,
}

async fn delete_jobs(write: &mut Write, ids: Vec<String>, before_ms: i64, now_ms: i64) -> Result<Deleted> {
    let mut deleted = Deleted::default();
    for id in ids {
        // A job that was retried in the meantime is kept.
        let sql = "select checkpoint from job where id = $1 and finish_time_ms < $2";
        let row = query(sql).bind((&id, before_ms)).fetch_optional(write.sql()).await?;
        let Some(row) = row else { continue };
        deleted.checkpoints.extend(row.try_get::<Option<String>>("checkpoint")?);
        for sql in [
            // Clients may be downloading the job's results or be about to use them.
            "update artifact set use_time_ms = max(use_time_ms, $2) \
             where digest in (select artifact from job_artifact where job = $1)",
            "delete from job_artifact where job = $1",
            "delete from job_dependency where job = $1 or after = $1",
            "delete from job_event where job = $1",
            "delete from job where id = $1",
        ] {
            query(sql).bind((&id, now_ms)).execute(write.sql()).await?;
        }
        deleted.jobs += 1;
    }
    Ok(deleted)
}
