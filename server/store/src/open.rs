//! Opening the database: its tables brought up to date, its connections pooled.

use super::connect::{
    ACQUIRE_TIMEOUT, POSTGRES_WRITERS, connect_once, connect_options, create_private, postgres_options,
};
use super::migrations::{bring_up_to_date, require_finished};
use super::sql::Pool;
use super::{Result, Store, StoreError};
use sqlx::Connection as _;
use sqlx::postgres::{PgListener, PgPoolOptions};
use sqlx::sqlite::{SqlitePool, SqlitePoolOptions};
use std::path::Path;

/// Number of read connections to SQLite. Reads are short, and more connections would only wait for the same disk and cores.
const READERS: u32 = 4;

/// Oldest accepted version of SQLite. Older versions can lose committed transactions when a checkpoint resets the log
/// while another connection reads it.
const SQLITE_MIN: (u32, u32, u32) = (3, 51, 3);
const SQLITE_MIN_TEXT: &str = "3.51.3";

/// Number of read connections to PostgreSQL.
const POSTGRES_READERS: u32 = 8;

/// Limits that PostgreSQL keeps for each connection. A process that is suspended or cut off in the middle of a write must
/// not keep the turn of all writers.
const POSTGRES_LIMITS: [(&str, &str); 5] = [
    ("idle_in_transaction_session_timeout", "10s"),
    ("tcp_keepalives_idle", "10"),
    ("tcp_keepalives_interval", "5"),
    ("tcp_keepalives_count", "3"),
    ("tcp_user_timeout", "30s"),
];

impl Store {
    /// Opens the database at `path`, creates it if it is missing, and brings its tables up to date.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the file cannot be opened; [`StoreError::Migration`] if its tables have a newer
    /// version; [`StoreError::SqliteTooOld`]; [`StoreError::Unfinished`].
    pub async fn open(path: &Path) -> Result<Self> {
        if !path.exists() {
            create_private(path)?;
        }
        let options = connect_options(path);
        let writer = pool(1).connect_with(options.clone()).await?;
        check_version(&writer).await?;
        bring_up_to_date(&Pool::sqlite(writer.clone())).await?;
        let readers = pool(READERS).connect_with(options.create_if_missing(false).pragma("query_only", "on")).await?;
        let (writers, readers) = (Pool::sqlite(writer), Pool::sqlite(readers));
        require_finished(&mut readers.acquire().await?).await?;
        Ok(Self::of(writers, readers, Some(path.to_owned())))
    }

    /// Connects to the PostgreSQL database of a `url` such as `postgres://user:password@host/database`, and brings its
    /// tables up to date. Several processes can do so at the same time.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if the server cannot be reached or refuses; [`StoreError::Migration`] and
    /// [`StoreError::NewerDatabase`] as [`Self::open`].
    pub async fn connect(url: &str) -> Result<Self> {
        let options = postgres_options(url)?.application_name("lightpath").options(POSTGRES_LIMITS);
        // A pool tries again until its time is up and then hides the cause.
        connect_once(&options).await?.close().await?;
        let pool = |connections| PgPoolOptions::new().max_connections(connections).acquire_timeout(ACQUIRE_TIMEOUT);
        let writers = pool(POSTGRES_WRITERS).test_before_acquire(false).connect_with(options.clone()).await?;
        bring_up_to_date(&Pool::postgres(writers.clone())).await?;
        let read_only = options.options([("default_transaction_read_only", "on")]);
        let readers = pool(POSTGRES_READERS).connect_with(read_only).await?;
        let listener = PgListener::connect_with(&readers).await?;
        let (writers, readers) = (Pool::postgres(writers), Pool::postgres(readers));
        require_finished(&mut readers.acquire().await?).await?;
        let store = Self::of(writers, readers, None);
        store.inner.time.read(store.readers()).await?;
        store.listen(listener).await?;
        Ok(store)
    }
}

fn pool(connections: u32) -> SqlitePoolOptions {
    // A connection to a file is not lost, and a test of it takes as long as a short statement.
    SqlitePoolOptions::new()
        .max_connections(connections)
        .idle_timeout(None)
        .max_lifetime(None)
        .test_before_acquire(false)
}

async fn check_version(pool: &SqlitePool) -> Result<()> {
    let found: String = sqlx::query_scalar("select sqlite_version()").fetch_one(pool).await?;
    let mut numbers = found.split('.').map(|part| part.parse::<u32>().unwrap_or(0));
    let mut next = || numbers.next().unwrap_or(0);
    if (next(), next(), next()) < SQLITE_MIN {
        return Err(StoreError::SqliteTooOld { found, required: SQLITE_MIN_TEXT });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sql::{query, scalar};

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
