//! Read access to a database that a server may be using, for checks and backups.

use super::connect::{connect_once, connect_options, create_private, postgres_options};
use super::datasets::with_pairs;
use super::migrations::{MIGRATIONS, has_table, require_finished, require_suitable};
use super::rows::{json, json_option, to_json};
use super::sql::{Connection, from_row, query, query_as, scalar};
use super::{Result, Store, StoreError};
use lightpath_domain::dataset::digest;
use serde_json::Value;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions as _, Connection as _};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Rows of one page of artifacts.
const PAGE: i64 = 1000;

/// A read-only connection to a database.
#[derive(Debug)]
pub struct Inspection {
    connection: Connection,
}

/// Numbers of stored records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Jobs in all states.
    pub jobs: u64,
    /// Recorded artifacts.
    pub artifacts: u64,
    /// Size of all recorded artifacts \[bytes\].
    pub artifact_bytes: u64,
    /// Versions of all kernels.
    pub kernel_versions: u64,
}

/// A recorded artifact.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredBlob {
    /// Digest of the content: `sha256-…`.
    pub digest: String,
    /// Size of the content \[bytes\].
    pub size_bytes: u64,
}

/// A row that refers to an artifact that is not recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DanglingReference {
    /// Name of the row that refers to the artifact, for example `jobs/0193…`.
    pub row: String,
    /// Digest of the artifact.
    pub digest: String,
}

impl Store {
    /// Opens a database that a server may be using. A database whose tables have another version is refused.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::open`]; [`StoreError::OlderDatabase`].
    pub async fn open_shared(path: &Path) -> Result<Self> {
        if path.exists() {
            let mut inspection = Inspection::open(path).await?;
            let steps = inspection.steps().await?.len();
            inspection.close().await?;
            if steps < MIGRATIONS.len() {
                return Err(StoreError::OlderDatabase);
            }
        }
        Self::open(path).await
    }

    /// Does the same for the PostgreSQL database of a `url`. An empty database gets its tables.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::connect`]; [`StoreError::OlderDatabase`].
    pub async fn connect_shared(url: &str) -> Result<Self> {
        let mut inspection = Inspection::connect_to_any(url).await?;
        let steps = if inspection.has_tables().await? { inspection.steps().await?.len() } else { MIGRATIONS.len() };
        inspection.close().await?;
        if steps < MIGRATIONS.len() {
            return Err(StoreError::OlderDatabase);
        }
        Self::connect(url).await
    }
}

impl Inspection {
    /// Opens the database at `path` for reading. It changes no table, and its folder may be on read-only media.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the file cannot be opened; [`StoreError::NewerDatabase`];
    /// [`StoreError::LogUnreadable`]; [`StoreError::Unfinished`].
    pub async fn open(path: &Path) -> Result<Self> {
        let mut connection = connect(path).await?;
        sqlx::query("pragma query_only = on").execute(&mut connection).await?;
        let mut inspection = Self { connection: Connection::SqliteFile(connection) };
        inspection.steps().await?;
        require_finished(&mut inspection.connection).await?;
        Ok(inspection)
    }

    /// Connects to the PostgreSQL database of a `url` for reading.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the server cannot be reached or refuses; [`StoreError::EmptyDatabase`];
    /// [`StoreError::NewerDatabase`]; [`StoreError::Unfinished`].
    pub async fn connect(url: &str) -> Result<Self> {
        let mut inspection = Self::connect_to_any(url).await?;
        if !inspection.has_tables().await? {
            return Err(StoreError::EmptyDatabase);
        }
        inspection.steps().await?;
        require_finished(&mut inspection.connection).await?;
        Ok(inspection)
    }

    async fn connect_to_any(url: &str) -> Result<Self> {
        let options = postgres_options(url)?.options([("default_transaction_read_only", "on")]);
        Ok(Self { connection: Connection::PostgresServer(connect_once(&options).await?) })
    }

    /// Whether a server has ever used this database of PostgreSQL.
    async fn has_tables(&mut self) -> Result<bool> {
        has_table(&mut self.connection, "_sqlx_migrations").await
    }

    /// Copies the present state of the database to `to`, which must not exist. A server can work on the database
    /// meanwhile. The copy is complete but not yet flushed to disk.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`], [`StoreError::DiskFull`], [`StoreError::LogUnreadable`].
    pub async fn snapshot(from: &Path, to: &Path) -> Result<()> {
        let mut connection = connect(from).await?;
        create_private(to)?;
        let copied = sqlx::query("vacuum into ?").bind(to.to_string_lossy()).execute(&mut connection).await;
        connection.close().await?;
        copied?;
        Ok(())
    }

    /// Names of the migrations that have been applied to the database, in order.
    ///
    /// # Errors
    ///
    /// [`StoreError::NewerDatabase`] if a newer version has migrated the database so that this one cannot work on it.
    pub async fn steps(&mut self) -> Result<Vec<String>> {
        require_suitable(&mut self.connection).await?;
        let sql = "select description from _sqlx_migrations where success order by version";
        Ok(scalar(sql).fetch_all(&mut self.connection).await?)
    }

    /// Errors that SQLite finds in pages, indexes, constraints and references between rows. PostgreSQL has programs of
    /// its own for that, such as `pg_amcheck`, so none are found there.
    pub async fn damages(&mut self) -> Result<Vec<String>> {
        if self.connection.is_postgres() {
            return Ok(Vec::new());
        }
        let mut damages: Vec<String> = scalar("pragma integrity_check").fetch_all(&mut self.connection).await?;
        damages.retain(|damage| damage != "ok");
        for row in query("pragma foreign_key_check").fetch_all(&mut self.connection).await? {
            let (table, parent): (String, String) = (row.try_get("table")?, row.try_get("parent")?);
            damages.push(format!("a row of {table} refers to a row of {parent} that does not exist"));
        }
        Ok(damages)
    }

    /// Descriptions of the jobs whose events contradict their state.
    pub async fn contradictions(&mut self) -> Result<Vec<String>> {
        let sql = "select id, ends from (select id, state, (select count(*) from job_event e where e.job = job.id \
                   and e.message = 'succeeded') as ends from job) counted \
                   where ends <> case state when 'succeeded' then 1 else 0 end";
        let rows = query(sql).fetch_all(&mut self.connection).await?;
        rows.iter()
            .map(|row| {
                let (id, ends): (String, i64) = (row.try_get("id")?, row.try_get("ends")?);
                Ok(format!("by its events, jobs/{id} has succeeded {ends} times, but its state contradicts this"))
            })
            .collect()
    }

    /// Ids of the finalized datasets whose digests do not match their content.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`]; [`StoreError::Corrupt`] if the content of a dataset cannot be parsed.
    pub async fn changed_datasets(&mut self) -> Result<Vec<String>> {
        let ids: Vec<String> = scalar("select id from dataset where digest is not null order by id")
            .fetch_all(&mut self.connection)
            .await?;
        let mut changed = Vec::new();
        for id in ids {
            let dataset = with_pairs(&mut self.connection, &id).await?;
            if dataset.digest.as_ref() != Some(&digest(&dataset)) {
                changed.push(id);
            }
        }
        Ok(changed)
    }

    /// Counts the stored records.
    pub async fn counts(&mut self) -> Result<Counts> {
        let (jobs, artifacts, artifact_bytes, kernel_versions) = query_as(
            "select (select count(*) from job), (select count(*) from artifact), \
             (select cast(coalesce(sum(size_bytes), 0) as bigint) from artifact), (select count(*) from kernel_version)",
        )
        .fetch_one(&mut self.connection)
        .await?;
        Ok(Counts { jobs, artifacts, artifact_bytes, kernel_versions })
    }

    /// The next page of artifacts in the order of their digests, behind `after`; empty at the end.
    pub async fn artifacts_after(&mut self, after: &str) -> Result<Vec<StoredBlob>> {
        let rows = query("select digest, size_bytes from artifact where digest > $1 order by digest limit $2")
            .bind((after, PAGE))
            .fetch_all(&mut self.connection)
            .await?;
        rows.iter().map(|row| Ok(from_row!(row, StoredBlob { digest, size_bytes }))).collect()
    }

    /// Whether the artifact is recorded.
    pub async fn has_artifact(&mut self, digest: &str) -> Result<bool> {
        let known = scalar("select exists (select 1 from artifact where digest = $1)").bind(digest);
        Ok(known.fetch_one(&mut self.connection).await?)
    }

    /// The identity of the data folder or the bucket in which the artifacts are; `None` if no server has recorded one.
    pub async fn artifact_place(&mut self) -> Result<Option<String>> {
        Ok(scalar("select identity from artifact_place").fetch_optional(&mut self.connection).await?)
    }

    /// Ids of the jobs that have a checkpoint, each with the checkpoint's digest.
    pub async fn checkpoints(&mut self) -> Result<Vec<(String, String)>> {
        let rows = query_as("select id, checkpoint from job where checkpoint is not null order by id");
        Ok(rows.fetch_all(&mut self.connection).await?)
    }

    /// Digest of the job's checkpoint.
    pub async fn checkpoint_of(&mut self, job: &str) -> Result<Option<String>> {
        let digest = scalar("select checkpoint from job where id = $1").bind(job);
        Ok(digest.fetch_optional(&mut self.connection).await?.flatten())
    }

    /// References of jobs to artifacts that are not recorded, as inputs or as results. Pairs and kernel versions refer
    /// to artifacts by foreign keys and need no check.
    pub async fn dangling_references(&mut self) -> Result<Vec<DanglingReference>> {
        let mut dangling = Vec::new();
        let mut after = String::new();
        loop {
            let sql = "select id, spec, result from job where id > $1 order by id limit $2";
            let rows = query(sql).bind((&after, PAGE)).fetch_all(&mut self.connection).await?;
            let Some(last) = rows.last() else { return Ok(dangling) };
            after = last.try_get("id")?;
            let mut references = BTreeSet::new();
            for row in &rows {
                let name = format!("jobs/{}", row.try_get::<String>("id")?);
                let mut collect = |value: &Value| {
                    collect_digests(value, &mut |digest| {
                        references.insert((name.clone(), digest.to_owned()));
                    })
                };
                collect(&json(row, "job.spec")?);
                let result: Option<Value> = json_option(row, "job.result")?;
                collect(&result.unwrap_or_default());
            }
            let digests: BTreeSet<&str> = references.iter().map(|(_, digest)| digest.as_str()).collect();
            let missing = "select value from json_each($1) where not exists \
                           (select 1 from artifact where digest = value)";
            let missing: Vec<String> =
                scalar(missing).bind(to_json("digest", &digests)?).fetch_all(&mut self.connection).await?;
            dangling.extend(
                references
                    .into_iter()
                    .filter(|(_, digest)| missing.contains(digest))
                    .map(|(row, digest)| DanglingReference { row, digest }),
            );
        }
    }

    /// Removes the checkpoints of these jobs from a snapshot that no server uses. The jobs will start from the
    /// beginning.
    pub async fn forget_checkpoints(path: &Path, jobs: &[String]) -> Result<()> {
        let mut connection = connect_options(path).create_if_missing(false).connect().await?;
        for job in jobs {
            let forget = sqlx::query("update job set checkpoint = null where id = ?").bind(job);
            forget.execute(&mut connection).await?;
        }
        // In this mode the database is a single file without a separate log.
        sqlx::query("pragma journal_mode = delete").execute(&mut connection).await?;
        connection.close().await?;
        Ok(())
    }

    /// Closes the connection.
    pub async fn close(self) -> Result<()> {
        Ok(self.connection.close().await?)
    }
}

/// Finds the texts of a JSON value that look like digests of artifacts. That of a dataset does not name an artifact.
fn collect_digests(value: &Value, found: &mut impl FnMut(&str)) {
    match value {
        Value::String(text) if text.len() == 71 && text.starts_with("sha256-") => found(text),
        Value::Array(values) => values.iter().for_each(|value| collect_digests(value, found)),
        Value::Object(fields) => {
            for (_, value) in fields.iter().filter(|(name, _)| *name != "dataset_digest") {
                collect_digests(value, found);
            }
        }
        _ => {}
    }
}

/// Connects to a database for reading. Readers of a database with a write-ahead log usually create its index, which
/// needs a folder that can be written.
async fn connect(path: &Path) -> Result<SqliteConnection> {
    match connect_options(path).create_if_missing(false).connect().await {
        Err(error) if is_unwritable(&error) => connect_without_writing(path).await,
        connected => Ok(connected?),
    }
}

/// Connects to a database in a folder that this process cannot write.
async fn connect_without_writing(path: &Path) -> Result<SqliteConnection> {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    let has_log = fs::metadata(log).is_ok_and(|log| log.len() > 0);
    // Without a log the file is complete, and nobody changes it. With a log, a server of another user may be running,
    // and its index of the log can be read.
    let options = SqliteConnectOptions::new().filename(path).read_only(true).immutable(!has_log);
    let mut connection = options.connect().await?;
    // SQLite opens the log when it reads first.
    match sqlx::query("select 1 from sqlite_master limit 1").execute(&mut connection).await {
        Err(error) if has_log && is_unwritable(&error) => Err(StoreError::LogUnreadable),
        Err(error) => Err(error.into()),
        Ok(_) => Ok(connection),
    }
}

/// Whether SQLite could not open the database or its log because a file or a folder cannot be written.
fn is_unwritable(error: &sqlx::Error) -> bool {
    /// Primary codes `SQLITE_READONLY` and `SQLITE_CANTOPEN`. The lowest byte of an extended code is the primary one.
    const CODES: [u32; 2] = [8, 14];
    let code = error.as_database_error().and_then(|error| error.code()).and_then(|code| code.parse::<u32>().ok());
    code.is_some_and(|code| CODES.contains(&(code & 0xff)))
}
