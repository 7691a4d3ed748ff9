//! Connections to either database.

use sqlx::pool::PoolConnection;
use sqlx::{Connection as _, PgConnection, PgPool, Postgres, Sqlite, SqliteConnection, SqlitePool, Transaction};

/// A connection to either database.
#[derive(Debug)]
pub(crate) enum Connection {
    /// One of a pool.
    Sqlite(PoolConnection<Sqlite>),
    /// One of a pool.
    Postgres(PoolConnection<Postgres>),
    /// One that belongs to no pool.
    SqliteFile(SqliteConnection),
    /// One that belongs to no pool.
    PostgresServer(PgConnection),
    /// A transaction that only reads, and sees one state of the database.
    SqliteSnapshot(Transaction<'static, Sqlite>),
    /// A transaction that only reads, and sees one state of the database.
    PostgresSnapshot(Transaction<'static, Postgres>),
}

/// Connections to either database.
#[derive(Clone, Debug)]
pub(crate) enum Pool {
    Sqlite(SqlitePool),
    Postgres(PgPool),
}

/// A connection as its database knows it.
pub(super) enum Raw<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
}

/// Where a statement runs.
pub(crate) trait Target {
    /// The connection of the statement, which is returned to its pool afterwards if it has one.
    fn connect(&mut self) -> impl Future<Output = Result<Lent<'_>, sqlx::Error>> + Send;
}

/// A connection for one statement.
pub(crate) enum Lent<'c> {
    Borrowed(&'c mut Connection),
    Own(Box<Connection>),
}

impl Lent<'_> {
    pub(super) fn raw(&mut self) -> Raw<'_> {
        match self {
            Self::Borrowed(connection) => connection.raw(),
            Self::Own(connection) => connection.raw(),
        }
    }
}

impl Connection {
    pub(super) fn raw(&mut self) -> Raw<'_> {
        match self {
            Self::Sqlite(connection) => Raw::Sqlite(connection),
            Self::SqliteFile(connection) => Raw::Sqlite(connection),
            Self::Postgres(connection) => Raw::Postgres(connection),
            Self::PostgresServer(connection) => Raw::Postgres(connection),
            Self::SqliteSnapshot(transaction) => Raw::Sqlite(transaction),
            Self::PostgresSnapshot(transaction) => Raw::Postgres(transaction),
        }
    }

    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self, Self::Postgres(_) | Self::PostgresServer(_) | Self::PostgresSnapshot(_))
    }

    /// Closes a connection of a pool of PostgreSQL when it is dropped, so that its transaction ends with it.
    pub(crate) fn close_on_drop(&mut self) {
        if let Self::Postgres(connection) = self {
            connection.close_on_drop();
        }
    }

    /// Closes a connection that belongs to no pool, and returns others to theirs.
    pub(crate) async fn close(self) -> Result<(), sqlx::Error> {
        match self {
            Self::SqliteFile(connection) => connection.close().await,
            Self::PostgresServer(connection) => connection.close().await,
            _ => Ok(()),
        }
    }
}

impl Pool {
    /// A connection for several statements, each of which sees the newest state.
    pub(crate) async fn acquire(&self) -> Result<Connection, sqlx::Error> {
        match self {
            Self::Sqlite(pool) => Ok(Connection::Sqlite(pool.acquire().await?)),
            Self::Postgres(pool) => Ok(Connection::Postgres(pool.acquire().await?)),
        }
    }

    /// Begins a transaction that only reads, and sees one state of the database.
    pub(crate) async fn begin(&self) -> Result<Connection, sqlx::Error> {
        const BEGIN: &str = "begin isolation level repeatable read, read only";
        match self {
            Self::Sqlite(pool) => Ok(Connection::SqliteSnapshot(pool.begin().await?)),
            Self::Postgres(pool) => Ok(Connection::PostgresSnapshot(pool.begin_with(BEGIN).await?)),
        }
    }

    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self, Self::Postgres(_))
    }

    /// Waits for statements in progress and closes the connections.
    pub(crate) async fn close(&self) {
        match self {
            Self::Sqlite(pool) => pool.close().await,
            Self::Postgres(pool) => pool.close().await,
        }
    }
}

impl Target for &mut Connection {
    async fn connect(&mut self) -> Result<Lent<'_>, sqlx::Error> {
        Ok(Lent::Borrowed(self))
    }
}

impl Target for &Pool {
    async fn connect(&mut self) -> Result<Lent<'_>, sqlx::Error> {
        Ok(Lent::Own(Box::new(self.acquire().await?)))
    }
}
