//! Single connections to a database: their options and limits.

use super::{Result, StoreError};
use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use std::fs::File;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::time::Duration;

/// How long a statement waits for a lock before it fails with BUSY. Only another process can hold such a lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Number of write connections to PostgreSQL. Writers take turns, so most of these wait.
pub(super) const POSTGRES_WRITERS: u32 = 4;

/// How long a caller waits for a connection to PostgreSQL.
pub(super) const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(30);

/// Connects to PostgreSQL, or says why that is impossible.
pub(super) async fn connect_once(options: &PgConnectOptions) -> Result<PgConnection> {
    match tokio::time::timeout(ACQUIRE_TIMEOUT, options.connect()).await {
        Ok(connected) => Ok(connected?),
        Err(_) => Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into()),
    }
}

/// Creates an empty file for a database that only its user can read. SQLite gives the log of a database the same mode.
pub(super) fn create_private(path: &Path) -> Result<()> {
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
