//! Single connections to a database: their options and limits.

use super::{Result, StoreError};
use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgConnection, PgSslMode};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use std::fs::File;
use std::net::IpAddr;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::str::FromStr as _;
use std::time::Duration;

/// How long a statement waits for a lock before it fails with BUSY. Only another process can hold such a lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Number of write connections to PostgreSQL. Writers take turns, so most of these wait.
pub(super) const POSTGRES_WRITERS: u32 = 4;

/// How long a caller waits for a connection to PostgreSQL.
pub(super) const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(30);

/// Options for the PostgreSQL database of a `url`.
///
/// # Errors
///
/// [`StoreError::OpenConnection`] for a server on another machine if neither the `url` nor the environment (`PGSSLMODE`)
/// says whether the connection is encrypted: the usual default would send all without encryption to a server without it.
pub(super) fn postgres_options(url: &str) -> Result<PgConnectOptions> {
    let options = PgConnectOptions::from_str(url)?;
    let is_undecided = matches!(options.get_ssl_mode(), PgSslMode::Allow | PgSslMode::Prefer);
    if is_undecided && !is_local(&options) {
        return Err(StoreError::OpenConnection { host: options.get_host().to_owned() });
    }
    Ok(options)
}

/// Whether the server is on this machine.
fn is_local(options: &PgConnectOptions) -> bool {
    let host = options.get_host().trim_start_matches('[').trim_end_matches(']');
    let is_loopback = host.parse().is_ok_and(|address: IpAddr| address.is_loopback());
    options.get_socket().is_some() || host.starts_with('/') || host.eq_ignore_ascii_case("localhost") || is_loopback
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encryption_to_another_machine_must_be_decided() {
        for url in [
            "postgres://ada@db.example/lightpath?sslmode=verify-full",
            "postgres://ada@db.example/lightpath?sslmode=require",
            "postgres://ada@db.example/lightpath?sslmode=disable",
            "postgres://ada@localhost/lightpath",
            "postgres://ada@127.0.0.1:5433/lightpath",
            "postgres://ada@[::1]/lightpath",
            "postgres://ada@%2Frun%2Fpostgresql/lightpath",
            "postgres:///lightpath?host=/run/postgresql",
        ] {
            assert!(postgres_options(url).is_ok(), "{url}");
        }
        for url in ["postgres://ada:secret@db.example/lightpath", "postgres://ada@10.0.0.7/lightpath?sslmode=prefer"] {
            let message = postgres_options(url).unwrap_err().to_string();
            assert!(message.contains("sslmode=verify-full") && !message.contains("secret"), "{message}");
        }
    }
}
