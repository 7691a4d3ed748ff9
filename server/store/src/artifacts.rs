//! Which artifacts are complete and on disk, and whose they are.

use super::rows::to_json;
use super::{Store, StoreError};
use sqlx::{Row, SqliteConnection};

/// An artifact that is on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArtifactRecord {
    /// `sha256-…`.
    pub digest: String,
    /// Size of the content.
    pub size_bytes: u64,
    /// [ms since 1970]
    pub create_time_ms: i64,
    /// When somebody last stored it, or was told that it need not be stored [ms since 1970].
    pub use_time_ms: i64,
}

/// A use within this time of the last one need not be noted: reads stay reads.
const USE_RESOLUTION_MS: i64 = 3_600_000;

impl Store {
    /// Records that an artifact's file is complete and on disk; call it after that, never before. The same artifact
    /// again counts as used, and as its new owner's, too.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], also for a malformed digest.
    pub async fn record_artifact(
        &self,
        digest: &str,
        size_bytes: u64,
        owner: &str,
        now_ms: i64,
    ) -> Result<ArtifactRecord, StoreError> {
        let (digest, owner) = (digest.to_owned(), owner.to_owned());
        self.write(move |write| {
            Box::pin(async move {
                let row = sqlx::query(
                    "insert into artifact (digest, size_bytes, create_time_ms, use_time_ms) values (?1, ?2, ?3, ?3) \
                     on conflict do update set size_bytes = excluded.size_bytes, \
                     use_time_ms = max(use_time_ms, excluded.use_time_ms) returning *",
                )
                .bind(&digest)
                .bind(size_bytes as i64)
                .bind(now_ms)
                .fetch_one(write.sql())
                .await?;
                let sql = "insert into artifact_owner values (?, ?) on conflict do nothing";
                sqlx::query(sql).bind(digest).bind(owner).execute(write.sql()).await?;
                record_of(&row)
            })
        })
        .await
    }

    /// An artifact's record, where the artifact is stored, for somebody who goes on to use it: it is not collected for
    /// as long as if it had been stored now.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`]. That its use could not be noted for want of space is no error.
    pub async fn use_artifact(&self, digest: &str, now_ms: i64) -> Result<Option<ArtifactRecord>, StoreError> {
        let Some(record) = self.artifact(digest).await? else { return Ok(None) };
        if now_ms - record.use_time_ms < USE_RESOLUTION_MS {
            return Ok(Some(record));
        }
        let digest = digest.to_owned();
        let noted = self
            .write(move |write| {
                Box::pin(async move {
                    let sql = "update artifact set use_time_ms = ?2 where digest = ?1 returning *";
                    let row = sqlx::query(sql).bind(digest).bind(now_ms).fetch_optional(write.sql()).await?;
                    row.as_ref().map(record_of).transpose()
                })
            })
            .await;
        match noted {
            Err(StoreError::DiskFull) => Ok(Some(record)),
            noted => noted,
        }
    }

    /// Whether an artifact is `owner`'s, or something about one of these displays refers to it.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn artifact_concerns(&self, digest: &str, owner: &str, displays: &[String]) -> Result<bool, StoreError> {
        let sql = "with own as (select value as id from json_each(?3)) select \
                   exists (select 1 from artifact_owner where artifact = ?1 and owner = ?2) \
                   or exists (select 1 from job_artifact a join job on job.id = a.job \
                       where a.artifact = ?1 and job.display in own) \
                   or exists (select 1 from pair join dataset on dataset.id = pair.dataset \
                       where ?1 in (pair.phase, pair.photo) and dataset.display in own) \
                   or exists (select 1 from dataset where instr(alignment, ?1) > 0 and display in own) \
                   or exists (select 1 from kernel_version v join kernel on kernel.id = v.kernel \
                       where v.artifact = ?1 and kernel.display in own)";
        let concerns = sqlx::query_scalar(sql).bind(digest).bind(owner).bind(to_json("display", &displays)?);
        Ok(concerns.fetch_one(self.readers()).await?)
    }

    /// `more_bytes` may still be stored for `owner`, who may have `stored_bytes_max` (0: no limit).
    ///
    /// # Errors
    ///
    /// [`StoreError::OwnerBytes`].
    pub async fn require_owner_room(
        &self,
        owner: &str,
        more_bytes: u64,
        stored_bytes_max: u64,
    ) -> Result<(), StoreError> {
        require_room(&mut *self.readers().acquire().await?, owner, more_bytes, stored_bytes_max).await
    }

    /// An artifact's record, where the artifact is stored.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn artifact(&self, digest: &str) -> Result<Option<ArtifactRecord>, StoreError> {
        let row =
            sqlx::query("select * from artifact where digest = ?").bind(digest).fetch_optional(self.readers()).await?;
        row.as_ref().map(record_of).transpose()
    }
}

/// See [`Store::require_owner_room`].
pub(super) async fn require_room(
    sql: &mut SqliteConnection,
    owner: &str,
    more_bytes: u64,
    stored_bytes_max: u64,
) -> Result<(), StoreError> {
    if stored_bytes_max == 0 {
        return Ok(());
    }
    let query = sqlx::query_scalar("select bytes from owner_bytes where owner = ?").bind(owner);
    let stored_bytes = query.fetch_optional(sql).await?.map_or(0, i64::unsigned_abs);
    if stored_bytes.saturating_add(more_bytes) > stored_bytes_max {
        return Err(StoreError::OwnerBytes { stored_bytes, stored_bytes_max });
    }
    Ok(())
}

pub(super) fn record_of(row: &sqlx::sqlite::SqliteRow) -> Result<ArtifactRecord, StoreError> {
    Ok(ArtifactRecord {
        digest: row.try_get("digest")?,
        size_bytes: row.try_get::<i64, _>("size_bytes")?.unsigned_abs(),
        create_time_ms: row.try_get("create_time_ms")?,
        use_time_ms: row.try_get("use_time_ms")?,
    })
}
