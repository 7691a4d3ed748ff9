//! Records of the artifacts that are complete and on disk, and of their owners.

use super::rows::to_json;
use super::sql::{Connection, Row, from_row, query, scalar};
use super::{Result, Store, StoreError};

/// An artifact that is on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArtifactRecord {
    /// Digest of the content: `sha256-…`.
    pub digest: String,
    /// Size of the content \[bytes\].
    pub size_bytes: u64,
    /// Time when the artifact was first recorded \[ms since 1970\].
    pub create_time_ms: i64,
    /// Time of the last upload, or of the last request that found the artifact already stored \[ms since 1970\].
    pub use_time_ms: i64,
}

/// A use is recorded only if the last recorded use is at least this old \[ms\], so that most reads write nothing.
const USE_RESOLUTION_MS: i64 = 3_600_000;

impl Store {
    /// The identity of the data folder or the bucket in which the artifacts are. The first caller's `identity` is
    /// recorded, and also one that replaces the recorded `former` one, from which the artifacts have moved.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], also if the identity is malformed.
    pub async fn artifact_place(&self, identity: &str, former: Option<&str>) -> Result<String> {
        let (identity, former) = (identity.to_owned(), former.map(str::to_owned));
        self.write(async move |write| {
            let sql = "insert into artifact_place values (1, $1) on conflict do nothing";
            query(sql).bind(&identity).execute(write.sql()).await?;
            let sql = "update artifact_place set identity = $1 where identity = $2";
            query(sql).bind((&identity, former)).execute(write.sql()).await?;
            Ok(scalar("select identity from artifact_place").fetch_one(write.sql()).await?)
        })
        .await
    }

    /// Records an artifact that is stored. Recording it again updates its time of use and adds `owner` to its owners. While
    /// the artifact is being removed from a bucket nothing is recorded, and the inner error is the mark of the removal,
    /// unless it is the mark that the caller has `seen` before it stored the artifact anew.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], also if the digest is malformed.
    pub async fn record_artifact(
        &self,
        digest: &str,
        size_bytes: u64,
        owner: &str,
        seen: Option<&str>,
        now_ms: i64,
    ) -> Result<Result<ArtifactRecord, String>> {
        let (digest, owner, seen) = (digest.to_owned(), owner.to_owned(), seen.map(str::to_owned));
        self.write(async move |write| {
            if let Some(seen) = seen {
                let sql = "delete from artifact_removal where digest = $1 and mark = $2";
                query(sql).bind((&digest, seen)).execute(write.sql()).await?;
            }
            let row = query(
                "insert into artifact (digest, size_bytes, create_time_ms, use_time_ms) select $1, $2, $3, $3 \
                 where not exists (select 1 from artifact_removal where digest = $1) \
                 on conflict (digest) do update set size_bytes = excluded.size_bytes, \
                 use_time_ms = max(artifact.use_time_ms, excluded.use_time_ms) returning *",
            )
            .bind((&digest, size_bytes as i64, now_ms))
            .fetch_optional(write.sql())
            .await?;
            let Some(row) = row else {
                let sql = "select mark from artifact_removal where digest = $1";
                return Ok(Err(scalar(sql).bind(digest).fetch_one(write.sql()).await?));
            };
            let sql = "insert into artifact_owner values ($1, $2) on conflict do nothing";
            query(sql).bind((digest, owner)).execute(write.sql()).await?;
            record_of(&row).map(Ok)
        })
        .await
    }

    /// The record of an artifact that the caller is about to use; `None` if it is not recorded. The time of use is
    /// updated, so that the artifact is kept as long as one that is stored now.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`]. A full disk, which prevents the update of the time of use, is no error.
    pub async fn use_artifact(&self, digest: &str, now_ms: i64) -> Result<Option<ArtifactRecord>> {
        let Some(record) = self.artifact(digest).await? else { return Ok(None) };
        if now_ms - record.use_time_ms < USE_RESOLUTION_MS {
            return Ok(Some(record));
        }
        let digest = digest.to_owned();
        let updated = self
            .write(async move |write| {
                let sql = "update artifact set use_time_ms = $2 where digest = $1 returning *";
                let row = query(sql).bind((digest, now_ms)).fetch_optional(write.sql()).await?;
                row.as_ref().map(record_of).transpose()
            })
            .await;
        match updated {
            Err(StoreError::DiskFull) => Ok(Some(record)),
            updated => updated,
        }
    }

    /// Whether an artifact belongs to `owner`, or a record about one of these displays refers to it.
    pub async fn artifact_concerns(&self, digest: &str, owner: &str, displays: &[String]) -> Result<bool> {
        let sql = "with own as (select value as id from json_each($3)) select \
                   exists (select 1 from artifact_owner where artifact = $1 and owner = $2) \
                   or exists (select 1 from job_artifact a join job on job.id = a.job \
                       where a.artifact = $1 and job.display in (select id from own)) \
                   or exists (select 1 from pair join dataset on dataset.id = pair.dataset \
                       where $1 in (pair.pattern, pair.photo) and dataset.display in (select id from own)) \
                   or exists (select 1 from dataset where instr(alignment, $1) > 0 and display in (select id from own)) \
                   or exists (select 1 from kernel_version v join kernel on kernel.id = v.kernel \
                       where v.artifact = $1 and kernel.display in (select id from own))";
        let concerns = scalar(sql).bind((digest, owner, to_json("display", &displays)?));
        Ok(concerns.fetch_one(self.readers()).await?)
    }

    /// Checks that `owner` may store `more_bytes`. `stored_bytes_max` is the limit of each owner (0: no limit).
    ///
    /// # Errors
    ///
    /// [`StoreError::OwnerBytes`].
    pub async fn require_owner_room(&self, owner: &str, more_bytes: u64, stored_bytes_max: u64) -> Result<()> {
        require_room(&mut self.readers().acquire().await?, owner, more_bytes, stored_bytes_max).await
    }

    /// The record of an artifact; `None` if it is not recorded.
    pub async fn artifact(&self, digest: &str) -> Result<Option<ArtifactRecord>> {
        let row = query("select * from artifact where digest = $1").bind(digest).fetch_optional(self.readers()).await?;
        row.as_ref().map(record_of).transpose()
    }
}

/// Does the work of [`Store::require_owner_room`].
pub(super) async fn require_room(
    sql: &mut Connection,
    owner: &str,
    more_bytes: u64,
    stored_bytes_max: u64,
) -> Result<()> {
    if stored_bytes_max == 0 {
        return Ok(());
    }
    let query = scalar("select bytes from owner_bytes where owner = $1").bind(owner);
    let stored_bytes = query.fetch_optional(sql).await?.map_or(0, i64::unsigned_abs);
    if stored_bytes.saturating_add(more_bytes) > stored_bytes_max {
        return Err(StoreError::OwnerBytes { stored_bytes, stored_bytes_max });
    }
    Ok(())
}

pub(super) fn record_of(row: &Row) -> Result<ArtifactRecord> {
    Ok(from_row!(row, ArtifactRecord { digest, size_bytes, create_time_ms, use_time_ms }))
}
