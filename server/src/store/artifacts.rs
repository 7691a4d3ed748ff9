//! Which artifacts are complete and on disk.

use super::{Store, StoreError};
use sqlx::Row;

/// An artifact that is on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArtifactRecord {
    /// `sha256-…`.
    pub digest: String,
    /// Size of the content.
    pub size_bytes: u64,
    /// [ms since 1970]
    pub create_time_ms: i64,
}

impl Store {
    /// Records that an artifact's file is complete and on disk; call it after that, never before. The same artifact
    /// again changes nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], also for a malformed digest.
    pub async fn record_artifact(
        &self,
        digest: &str,
        size_bytes: u64,
        now_ms: i64,
    ) -> Result<ArtifactRecord, StoreError> {
        let digest = digest.to_owned();
        self.write(move |write| {
            Box::pin(async move {
                let row = sqlx::query(
                    "insert into artifact (digest, size_bytes, create_time_ms) values (?, ?, ?) \
                     on conflict do update set size_bytes = excluded.size_bytes returning *",
                )
                .bind(digest)
                .bind(size_bytes as i64)
                .bind(now_ms)
                .fetch_one(write.sql())
                .await?;
                record_of(&row)
            })
        })
        .await
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

fn record_of(row: &sqlx::sqlite::SqliteRow) -> Result<ArtifactRecord, StoreError> {
    Ok(ArtifactRecord {
        digest: row.try_get("digest")?,
        size_bytes: row.try_get::<i64, _>("size_bytes")?.unsigned_abs(),
        create_time_ms: row.try_get("create_time_ms")?,
    })
}
