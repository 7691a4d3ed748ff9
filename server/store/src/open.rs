//! Opening the database: SQLite's files and pragmas, PostgreSQL's connections, migrations.

use super::StoreError;
use super::changes::Changes;
use super::database_time::DatabaseTime;
use super::processes::Living;
use super::sql::{Connection, Pool, scalar};
use super::transfer::marked_source;
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::postgres::{PgConnectOptions, PgConnection, PgListener, PgPoolOptions};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{AssertSqlSafe, ConnectOptions as _, Connection as _, SqlSafeStr};
use std::fs::File;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::str::FromStr as _;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio_util::task::AbortOnDropHandle;
use uuid::Uuid;

/// Number of read connections to SQLite. Reads are short, and more connections would only wait for the same disk and cores.
const READERS: u32 = 4;

/// How long a statement waits for a lock before it fails with BUSY. Only another process can hold such a lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Oldest accepted version of SQLite. Older versions can lose committed transactions when a checkpoint resets the log
/// while another connection reads it.
const SQLITE_MIN: (u32, u32, u32) = (3, 51, 3);
const SQLITE_MIN_TEXT: &str = "3.51.3";

/// Number of read connections to PostgreSQL.
const POSTGRES_READERS: u32 = 8;

/// Number of write connections to PostgreSQL. Writers take turns, so most of these wait.
pub(super) const POSTGRES_WRITERS: u32 = 4;

/// Limits that PostgreSQL keeps for each connection. A process that is suspended or cut off in the middle of a write must
/// not keep the turn of all writers.
const POSTGRES_LIMITS: [(&str, &str); 5] = [
    ("idle_in_transaction_session_timeout", "10s"),
    ("tcp_keepalives_idle", "10"),
    ("tcp_keepalives_interval", "5"),
    ("tcp_keepalives_count", "3"),
    ("tcp_user_timeout", "30s"),
];

/// How long a caller waits for a connection to PostgreSQL.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(30);

/// The text of a migration for each database.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) name: &'static str,
    pub(super) sqlite: &'static str,
    pub(super) postgres: &'static str,
}

macro_rules! steps {
    ($($name:literal),*) => {
        &[$(Step {
            name: $name,
            sqlite: include_str!(concat!("../../../migrations/sqlite/", $name, ".sql")),
            postgres: include_str!(concat!("../../../migrations/postgres/", $name, ".sql")),
        }),*]
    };
}

/// Migrations in order, one file each for each database. The first [`STEPS_OF_0_1_0`] make a database of version 0.1.0,
/// each for one subject. Changes of later versions are in files of their own. A released migration never changes. One that
/// programs of the version before can live with says so in `older_programs`, so that they need not stop.
pub(super) const MIGRATIONS: &[Step] = steps!(
    "0001_displays",
    "0002_artifacts",
    "0003_datasets",
    "0004_kernels",
    "0005_jobs",
    "0006_tokens",
    "0007_signing",
    "0008_devices",
    "0009_webhooks"
);

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
    pub(super) writers: Pool,
    pub(super) readers: Pool,
    pub(super) changes: Changes,
    /// The file of SQLite.
    pub(super) path: Option<PathBuf>,
    pub(super) time: DatabaseTime,
    pub(super) living: Living,
    /// Name of this handle for others, so that it does not hear itself.
    pub(super) process: String,
    /// The task that hears of the changes of other processes.
    pub(super) listener: Mutex<Option<AbortOnDropHandle<()>>>,
}

impl Store {
    /// Opens the database at `path`, creates it if it is missing, and brings its tables up to date.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the file cannot be opened; [`StoreError::Migration`] if its tables have a newer
    /// version; [`StoreError::SqliteTooOld`]; [`StoreError::Unfinished`].
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            create_private(path)?;
        }
        let options = connect_options(path);
        let writer = pool(1).connect_with(options.clone()).await?;
        check_version(&writer).await?;
        bring_up_to_date(&Pool::Sqlite(writer.clone())).await?;
        let readers = pool(READERS).connect_with(options.create_if_missing(false).pragma("query_only", "on")).await?;
        let (writers, readers) = (Pool::Sqlite(writer), Pool::Sqlite(readers));
        require_finished(&readers).await?;
        Ok(Self::of(writers, readers, Some(path.to_owned())))
    }

    /// Connects to the PostgreSQL database of a `url` such as `postgres://user:password@host/database`, and brings its
    /// tables up to date. Several processes can do so at the same time.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the server cannot be reached or refuses; [`StoreError::Migration`] and
    /// [`StoreError::NewerDatabase`] as [`Self::open`].
    pub async fn connect(url: &str) -> Result<Self, StoreError> {
        let options = PgConnectOptions::from_str(url)?.application_name("lightpath").options(POSTGRES_LIMITS);
        // A pool tries again until its time is up and then hides the cause.
        connect_once(&options).await?.close().await?;
        let pool = |connections| PgPoolOptions::new().max_connections(connections).acquire_timeout(ACQUIRE_TIMEOUT);
        let writers = pool(POSTGRES_WRITERS).test_before_acquire(false).connect_with(options.clone()).await?;
        bring_up_to_date(&Pool::Postgres(writers.clone())).await?;
        let read_only = options.options([("default_transaction_read_only", "on")]);
        let readers = pool(POSTGRES_READERS).connect_with(read_only).await?;
        let listener = PgListener::connect_with(&readers).await?;
        let (writers, readers) = (Pool::Postgres(writers), Pool::Postgres(readers));
        require_finished(&readers).await?;
        let store = Self::of(writers, readers, None);
        store.inner.time.read(store.readers()).await?;
        store.listen(listener).await?;
        Ok(store)
    }

    fn of(writers: Pool, readers: Pool, path: Option<PathBuf>) -> Self {
        let (changes, process) = (Changes::default(), Uuid::now_v7().to_string());
        let (time, living) = (DatabaseTime::default(), Living::default());
        let listener = Mutex::default();
        Self { inner: Arc::new(Inner { writers, readers, changes, path, time, living, process, listener }) }
    }

    /// Waits for operations in progress and closes the database. Later calls fail.
    pub async fn close(&self) {
        drop(self.inner.listener.lock().unwrap_or_else(PoisonError::into_inner).take());
        self.inner.readers.close().await;
        self.inner.writers.close().await;
    }

    pub(super) fn readers(&self) -> &Pool {
        &self.inner.readers
    }
}

/// Applies the migrations that are new to the database. One that a newer program has migrated stays as it is, if this
/// program can work on it.
async fn bring_up_to_date(writers: &Pool) -> Result<(), StoreError> {
    require_suitable(&mut writers.acquire().await?).await?;
    let migrator = |text| {
        let mut migrator = migrator(MIGRATIONS.len(), text);
        migrator.set_ignore_missing(true);
        migrator
    };
    // In PostgreSQL the migrator takes an advisory lock of its own.
    let done = match writers {
        Pool::Sqlite(writers) => migrator(|step| step.sqlite).run(writers).await,
        Pool::Postgres(writers) => migrator(|step| step.postgres).run(writers).await,
    };
    done.map_err(migration_error)
}

/// Refuses a database that a newer program has migrated so that this one cannot work on it.
pub(super) async fn require_suitable(connection: &mut Connection) -> Result<(), StoreError> {
    // The first migration makes this table.
    if !has_table(connection, "older_programs").await? {
        return Ok(());
    }
    let sql = "select min(version) from _sqlx_migrations where version > $1 and not exists \
               (select 1 from older_programs where migration = version and known_min <= $1)";
    let known = i64::try_from(MIGRATIONS.len()).unwrap_or(i64::MAX);
    let unsuitable: Option<i64> = scalar(sql).bind(known).fetch_one(connection).await?;
    unsuitable.map_or(Ok(()), |step| Err(StoreError::NewerDatabase { step }))
}

/// Whether the database has this table.
pub(super) async fn has_table(connection: &mut Connection, name: &str) -> Result<bool, StoreError> {
    let sql = match connection.is_postgres() {
        true => "select to_regclass($1) is not null",
        false => "select exists (select 1 from sqlite_master where type = 'table' and name = $1)",
    };
    Ok(scalar(sql).bind(name).fetch_one(connection).await?)
}

/// Refuses the target of an unfinished transfer.
async fn require_finished(readers: &Pool) -> Result<(), StoreError> {
    match marked_source(&mut readers.acquire().await?).await? {
        Some(_) => Err(StoreError::Unfinished),
        None => Ok(()),
    }
}

/// Connects to PostgreSQL, or says why that is impossible.
pub(super) async fn connect_once(options: &PgConnectOptions) -> Result<PgConnection, StoreError> {
    match tokio::time::timeout(ACQUIRE_TIMEOUT, options.connect()).await {
        Ok(connected) => Ok(connected?),
        Err(_) => Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into()),
    }
}

/// Creates an empty file for a database that only its user can read. SQLite gives the log of a database the same mode.
pub(super) fn create_private(path: &Path) -> Result<(), StoreError> {
    let created = File::options().write(true).create_new(true).mode(0o600).open(path);
    created.map(drop).map_err(|error| StoreError::Database(sqlx::Error::Io(error)))
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

pub(super) fn migration_error(error: MigrateError) -> StoreError {
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

/// Returns the first `steps` migrations, with their text for one database.
pub(super) fn migrator(steps: usize, text: fn(&Step) -> &'static str) -> Migrator {
    let migrations = MIGRATIONS.iter().take(steps).zip(1..).map(|(step, version)| {
        // The text is compiled into the program and contains no outside input.
        let sql = AssertSqlSafe(text(step)).into_sql_str();
        Migration::new(version, step.name.into(), MigrationType::Simple, sql, false)
    });
    Migrator::with_migrations(migrations.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sql::{query, scalar};

    #[test]
    fn every_migration_is_listed_in_order() {
        for database in ["sqlite", "postgres"] {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../migrations").join(database);
            let mut files: Vec<String> =
                std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
            files.sort();
            let listed: Vec<String> = MIGRATIONS.iter().map(|step| format!("{}.sql", step.name)).collect();
            assert_eq!(files, listed, "{database}");
        }
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
        let mode: String = scalar("pragma journal_mode").fetch_one(store.readers()).await.unwrap();
        assert_eq!(mode, "wal");
        let synchronous: i64 = scalar("pragma synchronous").fetch_one(&store.inner.writers).await.unwrap();
        assert_eq!(synchronous, 2, "FULL");
        assert!(query("delete from display").execute(store.readers()).await.is_err());
    }
}
