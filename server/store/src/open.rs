//! Opening the database: files, pragmas, migrations.

use super::StoreError;
use super::changes::Changes;
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{AssertSqlSafe, SqlSafeStr};
use std::fs::File;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Number of read connections. Reads are short, and more connections would only wait for the same disk and cores.
const READERS: u32 = 4;

/// How long a statement waits for a lock before it fails with BUSY. Only another process can hold such a lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Oldest accepted version of SQLite. Older versions can lose committed transactions when a checkpoint resets the log
/// while another connection reads it.
const SQLITE_MIN: (u32, u32, u32) = (3, 51, 3);
const SQLITE_MIN_TEXT: &str = "3.51.3";

/// Migrations in order, one file each. The first [`STEPS_OF_0_1_0`] make a database of version 0.1.0, each for one
/// subject. Changes of later versions are in files of their own. A released migration never changes.
pub(super) const MIGRATIONS: &[(&str, &str)] = &[
    ("0001_displays", include_str!("../../../migrations/0001_displays.sql")),
    ("0002_artifacts", include_str!("../../../migrations/0002_artifacts.sql")),
    ("0003_datasets", include_str!("../../../migrations/0003_datasets.sql")),
    ("0004_kernels", include_str!("../../../migrations/0004_kernels.sql")),
    ("0005_jobs", include_str!("../../../migrations/0005_jobs.sql")),
    ("0006_tokens", include_str!("../../../migrations/0006_tokens.sql")),
    ("0007_signing", include_str!("../../../migrations/0007_signing.sql")),
    ("0008_devices", include_str!("../../../migrations/0008_devices.sql")),
    ("0009_webhooks", include_str!("../../../migrations/0009_webhooks.sql")),
];

/// Number of migrations of the oldest version whose databases can be migrated.
#[cfg(test)]
pub(super) const STEPS_OF_0_1_0: usize = 9;

/// A handle to the database; see the documentation of the crate.
#[derive(Clone, Debug)]
pub struct Store {
    pub(super) inner: Arc<Inner>,
}

#[derive(Debug)]
pub(super) struct Inner {
    pub(super) writer: SqlitePool,
    pub(super) readers: SqlitePool,
    pub(super) changes: Changes,
    pub(super) path: PathBuf,
}

impl Store {
    /// Opens the database at `path`, creates it if it is missing, and brings its tables up to date.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the file cannot be opened; [`StoreError::Migration`] if its tables have a newer
    /// version; [`StoreError::SqliteTooOld`].
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            create_private(path)?;
        }
        let options = connect_options(path);
        let writer = pool(1).connect_with(options.clone()).await?;
        check_version(&writer).await?;
        migrator(MIGRATIONS.len()).run(&writer).await.map_err(migration_error)?;
        let readers = pool(READERS).connect_with(options.create_if_missing(false).pragma("query_only", "on")).await?;
        Ok(Self { inner: Arc::new(Inner { writer, readers, changes: Changes::default(), path: path.to_owned() }) })
    }

    /// Waits for operations in progress and closes the files. Later calls fail.
    pub async fn close(&self) {
        self.inner.readers.close().await;
        self.inner.writer.close().await;
    }

    pub(super) fn readers(&self) -> &SqlitePool {
        &self.inner.readers
    }
}

/// Creates an empty file for a database that only its user can read. SQLite gives the log of a database the same mode.
pub(super) fn create_private(path: &Path) -> Result<(), StoreError> {
    let created = File::options().write(true).create_new(true).mode(0o600).open(path);
    created.map(drop).map_err(|error| sqlx::Error::Io(error).into())
}

/// Options of every connection.
pub(super) fn connect_options(path: &Path) -> SqliteConnectOptions {
    // Accepted jobs must survive a power failure: with FULL, a commit is on disk and not only in the page cache.
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(BUSY_TIMEOUT)
}

fn migration_error(error: MigrateError) -> StoreError {
    match error {
        MigrateError::VersionMissing(step) => StoreError::NewerDatabase { step },
        other => StoreError::Migration(other),
    }
}

fn pool(connections: u32) -> SqlitePoolOptions {
    SqlitePoolOptions::new().max_connections(connections).idle_timeout(None).max_lifetime(None)
}

async fn check_version(pool: &SqlitePool) -> Result<(), StoreError> {
    let found: String = sqlx::query_scalar("select sqlite_version()").fetch_one(pool).await?;
    let mut numbers = found.split('.').map(|part| part.parse::<u32>().unwrap_or(0));
    let mut next = || numbers.next().unwrap_or(0);
    if (next(), next(), next()) < SQLITE_MIN {
        return Err(StoreError::SqliteTooOld { found, required: SQLITE_MIN_TEXT });
    }
    Ok(())
}

/// Returns the first `steps` migrations.
pub(super) fn migrator(steps: usize) -> Migrator {
    let migrations = MIGRATIONS.iter().take(steps).zip(1..).map(|((name, sql), version)| {
        // The text is compiled into the program and contains no outside input.
        let sql = AssertSqlSafe(*sql).into_sql_str();
        Migration::new(version, (*name).into(), MigrationType::Simple, sql, false)
    });
    Migrator::with_migrations(migrations.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_migration_is_listed_in_order() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../migrations");
        let mut files: Vec<String> =
            std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
        files.sort();
        let listed: Vec<String> = MIGRATIONS.iter().map(|(name, _)| format!("{name}.sql")).collect();
        assert_eq!(files, listed);
    }

    #[tokio::test]
    async fn only_the_user_of_the_database_can_read_it() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.db");
        let store = Store::open(&path).await.unwrap();
        let copy = folder.path().join("copy.db");
        crate::Inspection::snapshot(&path, &copy).await.unwrap();
        let files: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap()).collect();
        assert!(files.len() >= 3, "the log is open: {files:?}");
        for file in files {
            assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o600, "{file:?}");
        }
        store.close().await;
    }

    #[tokio::test]
    async fn opening_twice_changes_nothing_and_readers_cannot_write() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.db");
        Store::open(&path).await.unwrap().close().await;
        let store = Store::open(&path).await.unwrap();
        let mode: String = sqlx::query_scalar("pragma journal_mode").fetch_one(store.readers()).await.unwrap();
        assert_eq!(mode, "wal");
        let synchronous: i64 = sqlx::query_scalar("pragma synchronous").fetch_one(&store.inner.writer).await.unwrap();
        assert_eq!(synchronous, 2, "FULL");
        assert!(sqlx::query("delete from display").execute(store.readers()).await.is_err());
    }
}
